"""The page of a fit in a browser: guess, fit and recording of a strike are of one loudness, and the fit is nearer."""

from __future__ import annotations

import json
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from scipy.signal import sosfilt

from sonic_bullet.files.loudness.meter import k_weighting
from sonic_bullet.files.recordings import read_audio
from sonic_bullet.records import Array, Material
from tests.apps.bake.page.offline_strikes import SR, played_gains
from tests.apps.cli.called_here import call_here
from tests.made.case import make
from tests.made.chromium import Browser, opened_page

BRASS = Material.isotropic("made", youngs_pa=1.0e11, poisson=0.36, density_kg_m3=8400, alpha_per_s=8.0, beta_s=4e-8)
HEARD_S = 0.5
WITHIN_DB = 0.3


def loudness_db(pressure: Array, sr: int) -> float:
    heard = sosfilt(k_weighting(sr), pressure[: round(HEARD_S * sr)])
    return float(10 * np.log10(heard @ heard / sr))


def struck(browser: Browser, button: int) -> dict[str, Any]:
    """What a press of a button of the first recording strikes, or plays."""
    browser.value(f"document.querySelectorAll('.takes .buttons')[0].querySelectorAll('button')[{button}].click()")
    browser.until("page.sound.bank && page.sound.context.state === 'running'")
    found: dict[str, Any] = browser.value(
        "({ body: page.body.name, gain: Array.from(page.lastStrike.gain), contact_s: page.lastStrike.contact_s,"
        " freq_hz: Array.from(page.modes.freq_hz), place: Array.from(page.lastStrike.hit.place), "
        " normal: page.lastStrike.hit.normal, played: page.lastRecording ?? null })"
    )
    return found


@pytest.mark.chromium
def test_before_after_and_the_recording_are_of_one_loudness(tmp_path: Path) -> None:
    make(tmp_path, BRASS, (0.12, 0.025, 0.006), guess=(1.2e11, 8400.0, 0.34), strikes=3)
    done = call_here(tmp_path, "fit", str(tmp_path), "-o", "brass.json", "--page", "fitted.html")
    assert done.returncode == 0, done.stderr
    entry = json.loads((tmp_path / "case.json").read_text())["recordings"][0]
    sound, sr = read_audio(tmp_path / entry["file"])
    with opened_page(tmp_path / "fitted.html", tmp_path / "home") as opened:
        assert opened.value("document.querySelector('#equal').checked")
        assert opened.value("page.recordings[0].name") == entry["file"]
        before, levels_db = None, {}
        for button, body in enumerate(("box, before", "box, after")):
            one = struck(opened, button)
            assert one["body"] == body
            np.testing.assert_allclose(one["place"], entry["strike"]["position"], atol=3e-3)
            np.testing.assert_allclose(one["normal"], [0, 0, 1])
            levels_db[body] = loudness_db(played_gains(opened, one["gain"], one["contact_s"]), SR)
            if body == "box, before":
                before = np.array(one["freq_hz"])
            else:
                lowest = np.abs(np.fft.rfft(sound[0])).argmax() * sr / sound.shape[1]
                of = int(np.abs(np.array(one["freq_hz"]) - lowest).argmin())
                assert before is not None
                assert abs(one["freq_hz"][of] / lowest - 1) < 2e-3 < abs(before[of] / lowest - 1)
        played = struck(opened, 2)["played"]
        levels_db["recording"] = loudness_db(sound[0] / np.abs(sound[0]).max() * played["gain"], sr)
        print(f"loudness in dB: {levels_db}")
        assert max(levels_db.values()) - min(levels_db.values()) < WITHIN_DB, levels_db
        assert opened.errors == []


def test_a_page_needs_a_shape(tmp_path: Path) -> None:
    made = make(tmp_path, BRASS, (0.12, 0.025, 0.006), guess=(1.2e11, 8400.0, 0.34), strikes=2, seconds=0.3)
    done = call_here(tmp_path, "fit", str(made.folder), "-o", "brass.json", "--page", "fitted.txt")
    assert done.returncode == 2 and "end the name with .html" in done.stderr
