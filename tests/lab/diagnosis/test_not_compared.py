"""What could not be compared is no distance: not 0.0, not perfect, and told by name."""

from __future__ import annotations

import ast
import json
from dataclasses import dataclass, replace
from pathlib import Path
from typing import ClassVar, Self

import numpy as np
import pytest

import sonic_bullet
from sonic_bullet.apps.cli.diagnose_command import run_diagnose
from sonic_bullet.effects import EFFECTS
from sonic_bullet.effects.protocol import Effect, Owner, Sound, Stage
from sonic_bullet.lab.diagnosis.diagnose import _warnings
from sonic_bullet.lab.diagnosis.evidence.baseline import takes_of
from sonic_bullet.lab.diagnosis.evidence.effect_evidence import evidence_of
from sonic_bullet.lab.diagnosis.prediction.prediction import predict
from sonic_bullet.lab.diagnosis.prediction.score import (
    EDGE_DB,
    AudioObservation,
    ComparableTakes,
    Incomparable,
    comparable,
    mean_db,
    predict_takes,
)
from sonic_bullet.lab.diagnosis.selection import stepwise as loop
from sonic_bullet.lab.diagnosis.selection.cross_validation import cross_validated
from sonic_bullet.lab.diagnosis.selection.stepwise import NothingCompared, SelectionEnd, select_effects
from sonic_bullet.lab.diagnosis.unexplained import describe_unexplained
from sonic_bullet.lab.effects.evidence import Evidence
from sonic_bullet.options.fit import DiagnoseOptions
from sonic_bullet.signal.log_spectral import noise_floor_db, white
from tests.lab.diagnosis.test_found_again import BAND, fitted
from tests.made.body import SR, recorded, truth
from tests.made.problems import posed

SOURCE = Path(sonic_bullet.__file__).parent


@pytest.mark.slow
def test_no_distance_has_a_number_to_fall_back_on() -> None:
    """No `or` with a number behind a call that gives a distance, and no `or 0.0` at all, anywhere in the package."""
    files = sorted(SOURCE.rglob("*.py"))
    assert len(files) > 200
    found = []
    for file in files:
        text = file.read_text()
        for node in ast.walk(ast.parse(text)):
            if isinstance(node, ast.BoolOp) and isinstance(node.op, ast.Or):
                zero = any(
                    isinstance(v, ast.Constant) and isinstance(v.value, float) and not v.value for v in node.values
                )
                found += [f"{file.name}:{node.lineno}: or 0.0"] if zero else []
                called = [c.func for v in node.values for c in ast.walk(v) if isinstance(c, ast.Call)]
                names = [f.attr if isinstance(f, ast.Attribute) else getattr(f, "id", "") for f in called]
                number = any(isinstance(v, ast.Constant | ast.Attribute) for v in node.values[1:])
                if number and any(n.endswith("_db") or n in ("distance", "least") for n in names):
                    found.append(f"{file.name}:{node.lineno}")
    assert not found


def test_nothing_measured_is_unexplained() -> None:
    end = select_effects(truth(), (), (), EFFECTS, BAND)
    assert end.verdict == "unexplained" and isinstance(end, NothingCompared)
    assert end.left_out == () and end.added == () and end.tried == ()
    assert describe_unexplained(end, ())["words"] == "nothing could be compared: nothing was measured"


def spoiled(takes: tuple[AudioObservation, ...], *which: int) -> tuple[AudioObservation, ...]:
    return tuple(replace(t, sample=np.full(len(t.sample), np.nan)) if i in which else t for i, t in enumerate(takes))


def test_strikes_that_are_no_numbers_are_unexplained_by_name() -> None:
    body = recorded()
    takes = spoiled(takes_of((body,)), 0, 1, 2, 3, 4)
    end = select_effects(fitted(body), (body,), takes, (), BAND)
    assert end.verdict == "unexplained" and isinstance(end, NothingCompared)
    assert [one.name for one in end.left_out] == [f"strike-{i}.wav" for i in range(5)]
    words = describe_unexplained(end, takes)["words"]
    assert words.startswith("nothing could be compared: strike-0.wav holds 11200 samples that are no numbers; ")
    assert words.endswith("; and 1 more")


def test_the_others_are_judged_and_those_that_could_not_be_are_named() -> None:
    body = recorded()
    takes = takes_of((body,))
    short, silent = replace(takes[1], sample=takes[1].sample[:300]), replace(takes[2], floor=white(1e3))
    end = select_effects(fitted(body), (body,), (*spoiled(takes[:1], 0), short, silent, *takes[3:]), (), BAND)
    assert isinstance(end, SelectionEnd) and end.verdict == "none"
    assert end.judged == takes[3:] and end.before_db == mean_db(takes[3:], predict_takes(end.before, takes[3:]))
    assert [str(one) for one in end.left_out] == [
        "strike-0.wav holds 11200 samples that are no numbers",
        "strike-1.wav holds 300 samples after the onset, and 512 are needed",
        "strike-2.wav does not stand 10 dB above the noise anywhere, nor does what the model plays of it",
    ]


def test_one_strike_of_no_numbers_does_not_spoil_the_noise_of_all() -> None:
    body = recorded()
    assert body.recorded is not None and body.recorded.signals is not None
    signals = body.recorded.signals.copy()
    signals[2] = np.nan
    some = replace(body, recorded=replace(body.recorded, signals=signals))
    found = comparable(takes_of((some,)), {some: predict(fitted(body), some)})
    assert (
        isinstance(found, ComparableTakes)
        and len(found.takes) == 4
        and [one.name for one in found.left_out] == ["strike-2.wav"]
    )
    signals[:] = np.nan
    silent = replace(some, recorded=replace(body.recorded, signals=signals))
    none = comparable(takes_of((silent,)), {silent: predict(fitted(body), silent)})
    assert isinstance(none, Incomparable) and len(none.left_out) == 5


def test_a_strike_that_neither_plays_above_the_noise_is_as_far_off_as_noise_makes() -> None:
    """Recorded silence is comparable with a model that plays it loud; one that plays it as silent is as near as noise
    lets anyone tell.
    """
    body = recorded()
    take = takes_of((body,))[0]
    quiet = replace(
        take,
        sample=1e-3 * np.sqrt(take.floor.variance.mean()) * np.random.default_rng(1).standard_normal(len(take.sample)),
    )
    loud, silent = predict(fitted(body), body), predict(replace(fitted(body), gain=1e-12), body)
    assert isinstance(comparable((quiet,), {body: loud}), ComparableTakes)
    assert isinstance(comparable((quiet,), {body: silent}), Incomparable)
    assert quiet.distance(loud) > 10.0
    assert quiet.distance(silent) == quiet.least(silent) == EDGE_DB
    assert take.distance(silent) > 10.0 and take.least(silent) == EDGE_DB


def test_the_distance_of_silence_is_what_noise_makes_of_a_cell_that_just_stands_above_it() -> None:
    """A steady tone 10.5 dB above white noise: the cells at its peak, all near the threshold; two takes of it are √2
    times as far from each other as one from what it is a take of.
    """
    t = np.arange(400_000) / SR
    power = 10 ** (10.5 / 10) * (np.hanning(512) ** 2).sum() / (np.hanning(512).sum() / 2) ** 2
    found = noise_floor_db(np.sqrt(power) * np.cos(2 * np.pi * 2000 * t), white(1.0), windows=(512,))
    assert found == pytest.approx(np.sqrt(2) * EDGE_DB, rel=0.12)


@dataclass(frozen=True)
class Spoils(Effect):
    """Plays no numbers: a state that is rejected, as far off as can be."""

    id: ClassVar[str] = "spoils"
    stage: ClassVar[Stage] = Stage.SOUND
    owner: ClassVar[Owner] = Owner.CHAIN
    reference: ClassVar[str] = "none"

    def apply(self, x: Sound) -> Sound:
        return replace(x, sample=x.sample * np.nan)

    def freedom(self) -> int:
        return 1

    @classmethod
    def propose(cls, evidence: Evidence) -> Self | None:
        return cls()


def test_what_cannot_be_played_is_rejected() -> None:
    """On today's main it was as near as noise alone, strike by strike."""
    body = recorded()
    takes, off = takes_of((body,)), replace(fitted(body), gain=0.05)
    assert mean_db(takes, predict_takes(replace(off, effects=(Spoils(),)), takes)) == np.inf
    found = cross_validated(off, posed((body,), takes, Spoils), evidence_of(off, (body,), BAND))
    assert [c.id for c in found] == ["spoils"] and (found[0].drop_db == -np.inf).all()
    end = select_effects(fitted(body), (body,), takes, (Spoils,), BAND)
    assert isinstance(end, SelectionEnd) and end.added == () and end.verdict == "none"


def test_a_model_that_cannot_be_played_compares_with_nothing(monkeypatch: pytest.MonkeyPatch) -> None:
    body = recorded()
    monkeypatch.setattr(loop, "refit_material", lambda h, _: h)
    end = select_effects(replace(fitted(body), effects=(Spoils(),)), (body,), takes_of((body,)), (), BAND)
    assert isinstance(end, NothingCompared) and len(end.left_out) == 5
    assert str(end.left_out[0]) == "strike-0.wav is played by the model with samples that are no numbers"


def test_the_command_says_it_on_the_console_in_json_and_on_the_page(
    tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    """A list of five lines and no mesh: none can be left out, so nothing is known."""
    lines = [{"freq_hz": f, "decay_per_s": 5.0, "amplitude": 1.0} for f in (310.0, 702.0, 1233.0, 1999.0, 2871.0)]
    guess = {"youngs_modulus": 7e10, "density": 2500, "poisson_ratio": 0.24}
    case = {
        "format": "sonic-bullet-case/1",
        "case": "few",
        "objects": {"bar": {"material": "glass", "elastic_guess": guess}},
        "sensor": {"type": "near-field microphone"},
        "band_hz": [20, 20000],
        "recordings": [{"object": "bar", "split": "fit", "features": lines}],
    }
    (tmp_path / "case.json").write_text(json.dumps(case))
    page, file = tmp_path / "page.html", tmp_path / "few.json"
    run_diagnose(str(tmp_path), DiagnoseOptions(json_to=str(file), report=str(page)))
    said, answer = capsys.readouterr().out, json.loads(file.read_text())
    why = "the list of lines of bar holds 5, and 8 are needed to leave some out in turn"
    assert "few: unexplained: nothing could be compared" in said and f"left: nothing could be compared: {why}" in said
    assert answer["verdict"] == "unexplained" and answer["unexplained"]["words"] == f"nothing could be compared: {why}"
    assert answer["not_compared"] == [
        {"split": "fit", "name": "the list of lines of bar", "why": why.removeprefix("the list of lines of bar ")}
    ]
    assert answer["errors"]["before"]["fit"] is None and answer["errors"]["floor"] is None
    assert "Nothing could be compared" in page.read_text() and why in page.read_text()


def test_what_was_left_out_of_a_split_is_a_warning() -> None:
    body = recorded()
    takes = takes_of((body,))
    end = select_effects(fitted(body), (body,), (*spoiled(takes[:1], 0), takes[1]), (), BAND)
    assert _warnings(end, {"fit": end.left_out}) == [
        "1 of split 'fit' could not be compared: strike-0.wav holds 11200 samples that are no numbers",
        "one strike alone: nothing can be left out, so no effect can be named; record more strikes",
    ]
