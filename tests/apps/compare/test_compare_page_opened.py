"""The page of `compare` in a browser: it opens offline, its players play, what bodies are called does nothing."""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest

from sonic_bullet.apps.compare.compare_page import page_entry, write_page
from sonic_bullet.apps.compare.compared_sides import compare_sides
from sonic_bullet.apps.compare.comparison_record import Consequence, Difference
from sonic_bullet.apps.compare.sides import Side
from sonic_bullet.files.storage.spooled_sound import KeptSound
from tests.made.chromium import Browser, opened_page

HOSTILE = '<script>document.title="ran"</script><img src=x onerror="document.title=1">'
SR, SECONDS = 48_000, 1.5
PHONE_PX, VORBIS_BLOCK = 360, 2048


def sound(gain: float) -> KeptSound:
    t = np.arange(round(SECONDS * SR)) / SR
    return KeptSound.of(gain * np.exp(-4 * t) * np.sin(2 * np.pi * 880 * t)[None])


def made(place: Path) -> Path:
    a, b = (Side(HOSTILE + ".py", sound(gain), SR) for gain in (1.0, 0.7))
    found = compare_sides(a, b)
    cause = Difference(HOSTILE, "mass", 1.0, 2.0, f"{HOSTILE}: mass 1 → 2 kg (+100 %)", True)
    found = replace(found, differences=(cause,), effects=(*found.effects, Consequence("level", HOSTILE)), exact=True)
    write_page(str(place), [page_entry(found), page_entry(compare_sides(a, a))])
    return place


@pytest.fixture(scope="module")
def browser(tmp_path_factory: pytest.TempPathFactory) -> Iterator[Browser]:
    with opened_page(made(tmp_path_factory.mktemp("page") / "out.html"), tmp_path_factory.mktemp("home")) as opened:
        yield opened


@pytest.mark.chromium
def test_nothing_is_fetched_and_no_name_runs(browser: Browser) -> None:
    assert browser.value("document.title") == "Two versions compared"
    assert browser.value("document.querySelectorAll('script').length") == 1
    assert browser.value("document.querySelector('.verdict').textContent").startswith("<script>")
    assert all(one.startswith(("file:", "data:")) for one in browser.asked)
    assert browser.errors == []


@pytest.mark.chromium
def test_players_play_and_switch_at_the_same_sample(browser: Browser) -> None:
    length = "(async () => { const c = new OfflineAudioContext(1, 1, 48000), x = [];"
    length += "for (const one of document.querySelectorAll('audio')) { const b = Uint8Array.from("
    length += "atob(one.src.split(',')[1]), c => c.charCodeAt(0)).buffer; x.push((await c.decodeAudioData(b)).length) }"
    one, other = browser.value(length + "return x })()")
    assert one == other
    assert abs(one - SECONDS * SR) <= VORBIS_BLOCK  # a decoder may leave out part of the first block, of both alike
    place = "+document.querySelector('.players input').value"
    said = "document.querySelector('[data-do=play]').textContent"
    heard = "document.querySelector('[data-do=switch] b').textContent"
    assert (browser.value(said), browser.value(heard)) == ("Play", "A")
    browser.value("document.querySelector('[data-do=play]').click()")
    first = browser.until(place)
    assert browser.value(said) == "Stop"
    browser.value("document.querySelector('[data-do=switch]').click()")
    assert browser.value(heard) == "B"
    browser.until(f"{place} > {first}")
    assert browser.value("!document.querySelector('.cursor').hidden")
    browser.until(f"{said} === 'Play'")
    assert browser.errors == []


@pytest.mark.chromium
def test_keys_do_what_buttons_do(browser: Browser) -> None:
    browser.value("document.querySelector('.players').focus()")
    said, heard = (f"document.querySelector('[data-do={x}]').textContent" for x in ("play", "switch"))
    before = browser.value(heard)
    for key in ("x", " "):
        browser.do("Input.dispatchKeyEvent", type="keyDown", key=key, text=key)
        browser.do("Input.dispatchKeyEvent", type="keyUp", key=key)
    assert browser.value(heard) != before
    browser.until(f"{said} === 'Stop'")
    browser.do("Input.dispatchKeyEvent", type="keyDown", key=" ", text=" ")
    assert browser.value(said) == "Play"


@pytest.mark.chromium
def test_a_phone_and_a_dark_room_have_a_page_of_their_own(browser: Browser, tmp_path: Path) -> None:
    browser.do("Emulation.setDeviceMetricsOverride", width=PHONE_PX, height=740, deviceScaleFactor=1, mobile=True)
    assert browser.value("document.documentElement.scrollWidth") <= PHONE_PX
    ink = "getComputedStyle(document.body).color"
    inks = []
    for scheme in ("light", "dark"):
        browser.do("Emulation.setEmulatedMedia", features=[{"name": "prefers-color-scheme", "value": scheme}])
        inks.append(browser.value(ink))
        browser.picture(tmp_path / f"{scheme}.png")
        assert (tmp_path / f"{scheme}.png").stat().st_size > 10_000
    assert inks[0] != inks[1]
