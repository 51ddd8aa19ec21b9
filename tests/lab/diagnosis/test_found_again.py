"""Every effect, played into recordings with noise, is proposed again with its own parameters; a body that lacks nothing
is left in peace.

The recordings are the same forward code's (the independent ones are in benchmarks/suite); what is tested here is the
way back.
"""

from __future__ import annotations

import re
import sys
from dataclasses import replace
from pathlib import Path
from types import ModuleType

import numpy as np
import pytest

from sonic_bullet.effects import EFFECTS, Effect
from sonic_bullet.effects.added_mass import AddedMass
from sonic_bullet.effects.amplitude_damping import AmplitudeDamping
from sonic_bullet.effects.amplitude_pitch import AmplitudePitch
from sonic_bullet.effects.contact_time import ContactTime
from sonic_bullet.effects.damping_law import DampingLaw
from sonic_bullet.effects.foreign_mode import ForeignMode
from sonic_bullet.effects.measurement_chain import MeasurementChain
from sonic_bullet.effects.rebound import Rebound
from sonic_bullet.effects.room import Room
from sonic_bullet.effects.support_damping import SupportDamping
from sonic_bullet.lab.diagnosis.evidence.baseline import takes_of
from sonic_bullet.lab.diagnosis.evidence.effect_evidence import evidence_of
from sonic_bullet.lab.diagnosis.evidence.refit import refit_material
from sonic_bullet.lab.diagnosis.prediction.hypothesis import Hypothesis
from sonic_bullet.lab.diagnosis.prediction.score import least_db, mean_db, predict_takes
from sonic_bullet.lab.diagnosis.prediction.struck_bodies import StruckBody
from sonic_bullet.lab.diagnosis.selection.stepwise import SelectionEnd, select_effects
from sonic_bullet.lab.effects.damping_law import propose_damping_law
from sonic_bullet.lab.effects.searches import propose
from tests.few_cases import parametrize_few
from tests.made.body import ALPHA, BETA, GAIN, plate, recorded

BAND = (50.0, 7_500.0)


def fitted(body: StruckBody) -> Hypothesis:
    """The baseline as lines give it: Rayleigh's law by least squares on the decays."""
    assert body.recorded is not None
    lines = body.recorded.lines
    w2 = (2 * np.pi * lines.freq_hz) ** 2
    a = np.stack([0.5 * np.ones(len(w2)), 0.5 * w2], axis=1)
    weight = 1 / lines.decay_per_s
    alpha, beta = np.linalg.lstsq(a * weight[:, None], lines.decay_per_s * weight, rcond=None)[0]
    correction = np.zeros(body.model.mode_count)
    good = body.line >= 0
    correction[good] = lines.freq_hz[body.line[good]] / body.model.freq_hz[good] - 1
    return Hypothesis(
        max(float(alpha), 1e-3), max(float(beta), 1e-12), GAIN, (), {"plate": np.clip(correction, -0.01, 0.01)}
    )


def ended(body: StruckBody) -> SelectionEnd:
    """The loop on a recorded plate."""
    return select_effects(fitted(body), (body,), takes_of((body,)), EFFECTS, BAND)


def test_nothing_is_added_where_nothing_lacks() -> None:
    end = ended(recorded())
    assert end.verdict == "none"
    assert end.added == ()
    assert end.before_db - end.floor_db < 0.2
    assert end.before.alpha_per_s == pytest.approx(ALPHA, rel=0.02)
    assert end.before.beta_s == pytest.approx(BETA, rel=0.02)
    assert end.before.gain == pytest.approx(GAIN, rel=0.01)


PLANTED: tuple[tuple[Effect, dict[str, float]], ...] = (
    (DampingLaw("constant-loss", 6e-3), {"eta": 0.01}),
    (SupportDamping(((0.0477, 0.0371, 0.0),), (9.0,)), {}),
    (ContactTime(2.6e-4, 0.016, -0.2, "hertz"), {}),
    (ForeignMode((1000.0, 2610.0), (11.0, 25.0), (1.2, 0.9), (0.3, -1.0)), {}),
    (AddedMass((0.0477, 0.0371, 0.0), 0.02), {"mass_kg": 0.1}),
    (MeasurementChain(high_pass_hz=1500.0, high_order=2), {}),
    (Room(1.1, 0.7, 11), {"rt60_s": 0.1}),
    (Rebound(0.013, 0.016, 0.45), {"gap_s": 0.02}),
    (AmplitudePitch(0.35, "velocity"), {"bend": 0.15}),
    (AmplitudeDamping(9.0, "velocity"), {"choke": 0.4}),
)


def close(found: Effect, planted: Effect, within: dict[str, float]) -> None:
    told, true = found.parameters(), planted.parameters()
    for name, share in within.items():
        assert told[name] == pytest.approx(true[name], rel=share), name


@pytest.mark.slow
@parametrize_few(("effect", "within"), PLANTED, (0, 2, 6), ids=lambda e: getattr(e, "id", ""))
def test_a_planted_effect_is_proposed(effect: Effect, within: dict[str, float]) -> None:
    """With its own numbers, and it brings what is played nearer to the recordings than the best of the baseline."""
    body = recorded(effect)
    takes = takes_of((body,))
    base = refit_material(fitted(body), (body,))
    evidence = evidence_of(base, (body,), BAND)
    found = propose(type(effect), evidence)
    assert found is not None
    close(found, effect, within)
    with_it = refit_material(replace(base, effects=(found,)), (body,), evidence.observed)
    before, after, floor = (
        mean_db(takes, predict_takes(base, takes)) or 0.0,
        mean_db(takes, predict_takes(with_it, takes)) or 0.0,
        least_db(takes, predict_takes(with_it, takes)) or 0.0,
    )
    assert after - floor < 0.35 * (before - floor)


@pytest.mark.slow
@parametrize_few("number", [1, 3], 1, ids=["support-damping", "foreign-mode"])
def test_a_planted_effect_is_named(number: int) -> None:
    effect, within = PLANTED[number]
    end = ended(recorded(effect))
    assert [c.id for c in end.added] == [effect.id]
    assert end.verdict == "explained"
    close(end.added[0].effect, effect, within)
    assert end.added[0].mean_db > 2 * max(end.added[0].control_db, 0.0)


def of_somebody_else() -> ModuleType:
    """The examples of docs/how-to/add-an-effect.md, as they stand."""
    page = Path(__file__).parents[3] / "docs" / "how-to" / "add-an-effect.md"
    source = "".join(re.findall(r"```python\n(.*?)```", page.read_text(encoding="utf-8"), re.S))
    theirs = ModuleType("theirs")
    sys.modules["theirs"] = theirs  # dataclasses look their module up
    exec(compile(source, "docs/how-to/add-an-effect.md", "exec"), theirs.__dict__)
    assert {*EFFECTS, theirs.SquareLaw, theirs.GroundedSpring} == set(theirs.effects)
    return theirs


@pytest.mark.slow
def test_an_effect_of_somebody_else_is_tried_and_named() -> None:
    theirs = of_somebody_else()
    body = recorded(theirs.SquareLaw(20.0), seconds=0.5)
    end = select_effects(fitted(body), (body,), takes_of((body,)), (DampingLaw, ForeignMode, theirs.SquareLaw), BAND)
    assert [c.id for c in end.added] == ["square-law"]
    assert end.added[0].effect.parameters()["q"] == pytest.approx(20.0, rel=0.05)


@pytest.mark.slow
def test_an_effect_of_somebody_else_may_move_and_mix_modes() -> None:
    """Its traits are all that the host knows: modes are paired with lines anew, and corrections come after it."""
    theirs = of_somebody_else()
    body = recorded(theirs.GroundedSpring(124, 3e5))
    end = select_effects(
        fitted(body), (body,), takes_of((body,)), (DampingLaw, ForeignMode, theirs.GroundedSpring), BAND
    )
    assert [c.id for c in end.added] == ["grounded-spring"]
    assert end.verdict == "explained"
    assert end.added[0].effect.parameters()["stiffness_n_m"] == pytest.approx(3e5, rel=0.1)


def test_proposals_depend_on_the_evidence_alone() -> None:
    """The same evidence, the same words; another object's impulse scale does not matter to a damping law."""
    body = recorded(DampingLaw("constant-loss", 6e-3))
    evidence = evidence_of(fitted(body), (body,), BAND)
    once, again = propose_damping_law(evidence), propose_damping_law(evidence)
    assert once == again
    louder = replace(
        evidence,
        observed=tuple(
            replace(h, amplitude=7 * h.amplitude, signal=7 * h.signal)
            for h in evidence.observed
            if h.signal is not None
        ),
    )
    assert propose_damping_law(louder) == once


def test_the_plate_is_what_it_says() -> None:
    model = plate()
    body = model.shape[:345, 2].astype(float)
    gram = body.T @ body * 0.4 / (22 * 14)  # grid sum of a product of sines over its interior: half a period a side
    assert np.allclose(gram, np.eye(model.mode_count), atol=1e-5)
