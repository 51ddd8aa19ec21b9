"""Every verdict of a diagnosis can be written: none, a band off, explained, unexplained, nothing compared."""

from __future__ import annotations

import json
from collections.abc import Callable
from dataclasses import replace
from html import escape
from importlib import import_module
from pathlib import Path
from types import SimpleNamespace
from typing import Any

import numpy as np
import pytest

from sonic_bullet.apps.bake.page import fitted_bodies
from sonic_bullet.apps.cli import diagnose_command
from sonic_bullet.apps.report.diagnosis_page import POLICY
from sonic_bullet.effects.damping_law import DampingLaw
from sonic_bullet.lab.diagnosis.diagnose import Diagnosis
from sonic_bullet.lab.diagnosis.evidence.baseline import takes_of
from sonic_bullet.lab.diagnosis.prediction.struck_bodies import StruckBody
from sonic_bullet.lab.diagnosis.selection.stepwise import select_effects
from sonic_bullet.lab.diagnosis.unexplained import describe_unexplained
from sonic_bullet.options.fit import DiagnoseOptions
from tests.lab.diagnosis.test_bands import one_band_louder, one_mode_more
from tests.lab.diagnosis.test_found_again import BAND, fitted
from tests.made.body import recorded, truth

STRUCK = "<p id='struck'>"  # in place of the page of a case that has meshes


def lossy() -> StruckBody:
    """Recorded with a constant loss factor."""
    return recorded(DampingLaw("constant-loss", 8e-3))


def spoiled() -> StruckBody:
    body = recorded()
    assert body.recorded is not None and body.recorded.signals is not None
    signals = np.full_like(body.recorded.signals, np.nan)
    return replace(body, recorded=replace(body.recorded, signals=signals))


def lossy_at(*place_m: tuple[float, float, float] | None) -> StruckBody:
    """The same, of strikes whose places are said to be these, the last of them those that follow."""
    body = lossy()
    places = [place_m[min(i, len(place_m) - 1)] for i in range(len(body.recordings))]
    moved = tuple(replace(r, position_m=at) for r, at in zip(body.recordings, places, strict=True))
    assert body.recorded is not None
    return replace(body, recordings=moved, recorded=replace(body.recorded, recordings=moved))


CASES: list[tuple[Callable[[], StruckBody], tuple[Any, ...], str, str]] = [
    (recorded, (), "none", ""),
    (one_band_louder, (), "unexplained", "dB more than played between"),
    (one_mode_more, (), "unexplained", "dB more than played between"),
    (lossy, (DampingLaw,), "explained", ""),
    (lossy, (), "unexplained", "most of it in the"),
    (lambda: lossy_at(None), (), "unexplained", "no strike has a place"),
    (lambda: lossy_at(None, (0.0, 0.0, 0.1)), (), "unexplained", "all strikes are at one place"),
    (spoiled, (), "unexplained", "nothing could be compared"),
]


@pytest.mark.parametrize(
    ("made", "effects", "verdict", "words"),
    CASES,
    ids=[
        *("none", "band off", "band off by a mode more", "explained", "unexplained"),
        *("no places", "one place", "nothing compared"),
    ],
)
def test_every_verdict_can_be_written(
    tmp_path: Path,
    monkeypatch: pytest.MonkeyPatch,
    capsys: pytest.CaptureFixture[str],
    made: Callable[[], StruckBody],
    effects: tuple[Any, ...],
    verdict: str,
    words: str,
) -> None:
    body = made()
    takes, base = takes_of((body,)), truth() if made is spoiled else fitted(body)
    end = select_effects(base, (body,), takes, effects, BAND)
    case: Any = SimpleNamespace(name="made", warnings=(), recordings=())
    material = SimpleNamespace(gamma_m2_s2=np.float64("nan"), poisson_ratio=0.3, covariance=np.full((5, 5), np.nan))
    fit: Any = SimpleNamespace(fit=material, has_material=True, objects=(body,), evidence=())
    errors: dict[str, Any] = {"before": {"fit": None}, "after": {"fit": np.float64(1.0)}, "floor": np.nan}
    left = describe_unexplained(end, takes)
    found = Diagnosis(case, fit, (body,), takes, end, errors, errors, {}, left, {}, ())
    module = import_module("sonic_bullet.lab.diagnosis.diagnose")  # as an attribute of its package it is the function
    monkeypatch.setattr(module, "diagnose", lambda *_, **__: found)
    monkeypatch.setattr(diagnose_command, "read_case", lambda _: case)
    monkeypatch.setattr(fitted_bodies, "struck_page", lambda *_: STRUCK)
    place, page = tmp_path / "d.json", tmp_path / "d.html" if verdict == "explained" else None
    asked = DiagnoseOptions(json_to=str(place), report=page and str(page), propose=True)
    diagnose_command.run_diagnose("made", asked)
    written = json.loads(place.read_text())
    assert written["verdict"] == verdict
    assert words in written["unexplained"].get("words", "")
    assert [one["id"] for one in written["effects"]] == ["damping-law"] * (verdict == "explained")
    for row in written["candidates"]:
        assert (row["word"] == "named") == (row["id"] in {one["id"] for one in written["effects"]}) and row["word"]
        assert row["standard_error_db"] > 0 and row["numbers"] == -1 and row["strikes"] == len(takes)
    said = capsys.readouterr().out
    assert ("named, or why not" in said) == bool(written["candidates"])
    assert "baseline, before anything is added: α not fitted" in said
    assert ("below 0 it leads away" in said) == bool(written["candidates"])
    if page is not None:  # every strike is heard thrice, and the effect's equation and the table are read
        text = page.read_text(encoding="utf-8")
        assert "no two models that these strikes leave open" in text[text.index("<h2>Next strike</h2>") :]
        assert "α not fitted, β not fitted, E/ρ not fitted, ν not fitted" in text  # their spreads are not finite
        verdict_line = text[text.index("<p class=verdict>") :].split("</p>")[0]
        assert "has a name: damping-law (material)" in verdict_line and "below 0 it leads away" in text
        assert f'srcdoc="{escape(STRUCK)}"' in text and POLICY in text
        assert text.count("<audio") == 3 * len(takes) and "d = ηω/2" in text and "named, or why not" in text
    assert "next strike: no two models that these strikes leave open" in said  # what is named was told from nothing
    assert written["next_strike"] is None
    assert written["baseline"]["gamma_m2_s2"] is None and written["errors"]["floor"] is None
    if "dB more" in words:
        assert all(isinstance(band["early"], bool) for band in written["unexplained"]["bands_off"])
