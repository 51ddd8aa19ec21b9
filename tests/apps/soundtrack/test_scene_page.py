"""The page of a scene in a browser: picture and sound have one clock, the sounds of the bodies add up to the mix."""

from __future__ import annotations

import base64
import json
import re
from collections.abc import Iterator
from pathlib import Path
from typing import Any

import numpy as np
import pytest
import soundfile

from sonic_bullet._engine import SWEEP_FLOOR_M_S
from sonic_bullet.apps.soundtrack.scene_page import LEAST_HEARD_DB
from tests.apps.cli.called_here import call_here
from tests.made.baked import error_db
from tests.made.chromium import Browser, opened_page

REPO = Path(__file__).resolve().parents[3]
SECONDS = "0.6"

MIX = """(async () => {
  await scene.player.open();
  const { buffers, data } = scene.player, length = Math.round(data.seconds * 48000);
  const context = new OfflineAudioContext(2, length, 48000);
  data.stems.forEach((stem, i) => {
    const source = context.createBufferSource(), level = context.createGain();
    source.buffer = buffers[i];
    level.gain.value = stem.gain;
    source.connect(level).connect(context.destination);
    source.start();
  });
  const made = await context.startRendering(), bytes = new Uint8Array(made.getChannelData(0).buffer);
  let text = "";
  for (let i = 0; i < bytes.length; i += 32768) text += String.fromCharCode(...bytes.subarray(i, i + 32768));
  return btoa(text);
})()"""

# What is named while it plays.
NAMED = """(() => {
  scene.words = [];
  const said = document.querySelector('#said');
  scene.named = new MutationObserver(() => said.textContent && scene.words.push(said.textContent));
  scene.named.observe(said, { childList: true });
})()"""

# The first mark is pressed; when it plays: the event's time, that from which it plays, and the marks that are chosen.
PRESSED = """(async () => {
  document.querySelector('.lane button:not(.span)').click();
  while (scene.player.began === null) await new Promise(done => setTimeout(done, 5));
  const marks = [...document.querySelectorAll('.lane [aria-current]')].map(mark => mark.title);
  return [scene.events.find(e => e.kind === 'impact').start_s, scene.player.from, marks];
})()"""


@pytest.fixture(scope="module")
def made(tmp_path_factory: pytest.TempPathFactory) -> Path:
    folder = tmp_path_factory.mktemp("scene")
    done = call_here(
        folder, "render", str(REPO / "scenes" / "bar.py"), "--seconds", SECONDS, "-o", "bar.wav", "--page", "bar.html",
        "--events", "bar.json",
    )  # fmt: skip
    assert done.returncode == 0, done.stderr
    return folder


@pytest.fixture(scope="module")
def browser(made: Path, tmp_path_factory: pytest.TempPathFactory) -> Iterator[Browser]:
    with opened_page(made / "bar.html", tmp_path_factory.mktemp("home")) as opened:
        yield opened


def data_of(page: Path) -> Any:
    found = re.search(r'id="data">(.*?)</script>', page.read_text(), re.S)
    assert found is not None
    return json.loads(found[1])


def test_a_page_holds_motion_sound_and_events(made: Path) -> None:
    data = data_of(made / "bar.html")
    told = json.loads((made / "bar.json").read_text())["sounding"]
    sounding = [one for one in told if one["kind"] in ("impact", "roll", "slide") and not one.get("reason")]
    heard = [
        one for one in sounding
        if (one["level_db"] is None or one["level_db"] >= LEAST_HEARD_DB)
        and (one["kind"] == "impact" or one["speed_m_s"] >= SWEEP_FLOOR_M_S)
    ]  # fmt: skip
    assert len(data["events"]) == len(heard) > 0
    left = len(sounding) - len(heard)
    assert any(note.startswith(f"{left} contacts are no marks") for note in data["notes"]) == (left > 0)
    assert data["seconds"] >= float(SECONDS)
    assert {one["kind"] for one in data["events"]} <= {"impact", "roll", "slide"}
    moving = [one for one in data["meshes"] if len(base64.b64decode(one["pose"]["base64"])) > 7 * 4]
    assert moving
    text = (made / "bar.html").read_text()
    assert text.count("Content-Security-Policy") == 2 and "https:" not in text.split("</style>")[0]


@pytest.mark.chromium
def test_the_stems_are_the_mix(browser: Browser, made: Path) -> None:
    mix, _ = soundfile.read(made / "bar.wav", always_2d=True)
    played = np.frombuffer(base64.b64decode(browser.value(MIX)), np.float32).astype(float)
    ours = mix[:, 0]
    count = min(len(played), len(ours))
    played, ours = played[:count], ours[:count]
    gain = float(played @ ours / (played @ played))
    off_db = error_db(gain * played, ours)
    print(f"stems against the mix: {off_db:.1f} dB")
    assert off_db < -60  # 16 bits of each
    assert browser.errors == []


@pytest.mark.chromium
def test_picture_and_sound_have_one_clock(browser: Browser, made: Path) -> None:
    browser.value(NAMED)
    browser.value("document.querySelector('#play').click()")
    browser.until("scene.player.began !== null && scene.player.now() > 0.2")
    browser.until("+document.querySelector('#time').value > 200")
    browser.until("scene.player.began === null")
    named = browser.value("scene.named.disconnect(), scene.words")
    assert [one for one in named if one.startswith("impact:")] and all(named)  # what sounds, while it plays
    assert browser.value("document.querySelectorAll('.lane [aria-current]').length") == 0
    data = data_of(made / "bar.html")
    which = next(i for i, one in enumerate(data["meshes"]) if len(one["pose"]["base64"]) > 1000)
    pose = np.frombuffer(base64.b64decode(data["meshes"][which]["pose"]["base64"]), np.float32).reshape(-1, 7)
    checked = 0
    for time_s in (0.0, 0.1, 0.25, 0.4):
        browser.value(f"scene.view.at({time_s})")
        seen = browser.value(f"scene.view.meshes[{which}].position.toArray()")
        at = time_s * data["fps"]
        wanted = [np.interp(at, np.arange(len(pose)), pose[:, x]) for x in range(3)]
        np.testing.assert_allclose(seen, wanted, atol=1e-6)
        checked += 1
    assert checked == 4


@pytest.mark.chromium
def test_the_picture_stays_at_an_impact_that_rings_on(browser: Browser) -> None:
    slow = "(s => { s.value = '%s'; s.dispatchEvent(new Event('change')) })(document.querySelector('#slow'))"
    browser.value(slow % 8)
    start_s, _, _ = browser.value(PRESSED)
    browser.until(f"scene.player.now() > {start_s + 0.01}")
    assert browser.value("scene.player.began !== null")
    assert browser.value("scene.player.seen()") == start_s
    browser.until(f"document.querySelector('#clock').value === '{start_s:.3f} s'")
    browser.value("document.querySelector('#play').click()")
    assert browser.value("scene.player.from") == start_s
    browser.value(slow % 1)


@pytest.mark.chromium
def test_a_phone_keeps_clock_and_words_in_sight(browser: Browser) -> None:
    browser.do("Emulation.setDeviceMetricsOverride", width=390, height=844, deviceScaleFactor=1, mobile=True)
    try:
        browser.value("window.scrollTo(0, document.body.scrollHeight)")
        assert browser.value("document.documentElement.scrollWidth") <= 390
        for one in ("view", "play", "clock", "said", "next"):
            box = f"(b => [b.left, b.top, b.right, b.bottom])(document.querySelector('#{one}').getBoundingClientRect())"
            left, top, right, bottom = browser.value(box)
            assert 0 <= left < right <= 390 and 0 <= top < bottom <= 844, one
    finally:
        browser.do("Emulation.clearDeviceMetricsOverride")


@pytest.mark.chromium
def test_an_event_is_heard_alone(browser: Browser) -> None:
    start_s, from_s, marked = browser.value(PRESSED)
    assert from_s == pytest.approx(max(start_s - 0.02, 0), abs=1e-6)
    said = browser.value("document.querySelector('#said').textContent")
    assert said.startswith("impact:") and set(marked) == {said} and " dB SPL peak at " in said
    assert browser.value("scene.view.marker.visible")
    browser.until("scene.player.began === null")
    assert browser.value("scene.player.from") == pytest.approx(start_s, abs=1e-6)  # where it happened
    shown = "[document.querySelector('#time').value, document.querySelector('#time').ariaValueText]"
    assert browser.value(shown) == [str(round(1000 * start_s)), f"{start_s:.3f} s"]
    beside = (
        "(b => [b.right + 10, (b.top + b.bottom) / 2])(document.querySelector('.lane button').getBoundingClientRect())"
    )
    browser.value("document.querySelector('.lane').scrollIntoView(), document.querySelector('#said').textContent = ''")
    x, y = browser.value(beside)
    for kind in ("mousePressed", "mouseReleased"):
        browser.do("Input.dispatchMouseEvent", type=kind, x=x, y=y, button="left", clickCount=1)
    assert browser.value("document.querySelector('#said').textContent") == said  # the nearest is meant
    browser.value("scene.player.stop()")
    lanes = browser.value("[...document.querySelectorAll('.lane')].filter(lane => lane.children.length).length")
    assert browser.value("document.querySelectorAll('.lane button[tabindex=\"0\"]').length") == lanes > 0  # one each
    assert browser.errors == []
    assert all(address.startswith(("file:", "data:")) for address in browser.asked), browser.asked


@pytest.mark.chromium
def test_buttons_go_by_level_and_by_time(browser: Browser, made: Path) -> None:
    text, data = (made / "bar.html").read_text(), data_of(made / "bar.html")
    one = data["events"][0]
    passed = one | {"start_s": 0.1, "end_s": 0.1, "speed_m_s": 0, "level_db": one["level_db"] + 3}
    roll = one | {"kind": "roll", "start_s": 0.2, "end_s": 0.3, "level_db": 40}
    three = json.dumps(data | {"events": [one, passed, roll]})
    (made / "three.html").write_text(re.sub(r'(?s)(id="data">).*?(</script>)', lambda m: m[1] + three + m[2], text))
    browser.go(made / "three.html")
    said = "document.querySelector('#said').textContent"
    words = [browser.value(f"scene.events[{number}].marks[0].title") for number in range(3)]
    assert f", 0.100 s, a neighbour's blow goes through, {one['level_db'] + 3:.0f} dB SPL peak at " in words[1]
    assert ", 0.200 to 0.300 s, " in words[2] and ", 40 dB SPL at " in words[2]
    steps = [("loudest", 1), ("loudest", 0), ("loudest", 2), ("loudest", 1)]  # by level, and from the loudest again
    steps += [("next", 2), ("next", 2), ("previous", 1), ("previous", 0), ("previous", 0)]
    for button, number in steps:
        browser.value(f"document.querySelector('#{button}').click()")
        assert browser.value(said) == words[number], button
        marks = "[...new Set([...document.querySelectorAll('.lane [aria-current]')].map(mark => mark.title))]"
        assert browser.value(marks) == [words[number]]
    browser.value("scene.player.stop()")
    assert browser.errors == []
