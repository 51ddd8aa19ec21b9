"""What a candidate effect must gain, and against what: not against numbers that the baseline may learn again."""

from __future__ import annotations

from dataclasses import dataclass, replace
from itertools import combinations
from typing import Any, ClassVar, Self

import numpy as np
import pytest
from scipy.optimize import nnls

from sonic_bullet.effects import EFFECTS
from sonic_bullet.effects.amplitude_damping import AmplitudeDamping
from sonic_bullet.effects.orthotropy import Orthotropy
from sonic_bullet.effects.protocol import Cost, Effect, Owner, Sound, Stage, Traits
from sonic_bullet.effects.radiation import Radiation
from sonic_bullet.effects.room import Room
from sonic_bullet.effects.support_damping import SupportDamping
from sonic_bullet.lab.diagnosis.evidence.baseline import _soft, takes_of
from sonic_bullet.lab.diagnosis.evidence.effect_evidence import evidence_of
from sonic_bullet.lab.diagnosis.evidence.recording_chain import LINKS, merge_line_chains
from sonic_bullet.lab.diagnosis.evidence.refit import refit_material
from sonic_bullet.lab.diagnosis.prediction.hypothesis import Hypothesis
from sonic_bullet.lab.diagnosis.prediction.score import mean_db, predict_takes
from sonic_bullet.lab.diagnosis.selection import stepwise as loop
from sonic_bullet.lab.diagnosis.selection.acceptance import Candidate, is_accepted
from sonic_bullet.lab.diagnosis.selection.cross_validation import _folds, cross_validated
from sonic_bullet.lab.diagnosis.selection.pitch_ratios import modes_off_lines
from sonic_bullet.lab.diagnosis.thresholds import RULES
from sonic_bullet.lab.effects.evidence import Evidence
from sonic_bullet.lab.effects.room import propose_room
from sonic_bullet.lab.effects.support_damping import _of
from sonic_bullet.lab.effects.support_damping.dashpot_fit import DashpotFit
from sonic_bullet.lab.effects.support_damping.support_subsets import _best, subsets
from sonic_bullet.records import ModalModel
from tests.few_cases import parametrize_few
from tests.lab.diagnosis.test_found_again import BAND, fitted
from tests.lab.diagnosis.test_recording_chain import BENT
from tests.made.body import plate, recorded, struck
from tests.made.problems import posed

WEAK = ((0.0477, 0.0371, 0.0), (0.0955, 0.0186, 0.0), (0.1432, 0.0464, 0.0))


@dataclass(frozen=True)
class Idle(Effect):
    """Does nothing, and says that it moves modes, so that corrections are learnt again."""

    id: ClassVar[str] = "mode-splitting"
    stage: ClassVar[Stage] = Stage.MODES
    owner: ClassVar[Owner] = Owner.OBJECT
    reference: ClassVar[str] = "none"
    traits: ClassVar[Traits] = Traits(moves_modes=True)

    def apply(self, x: ModalModel) -> ModalModel:
        return x

    def freedom(self) -> int:
        return 2

    @classmethod
    def propose(cls, evidence: Evidence) -> Self | None:
        return cls()


def test_what_corrections_alone_would_gain_is_no_effects() -> None:
    """Corrections that are three per mille off cost decibels; learnt again beside an effect that does nothing, they are
    not its gain.
    """
    body = recorded()
    rng = np.random.default_rng(3)
    h = fitted(body)
    assert h.correction is not None
    stale = replace(h, correction={"plate": h.correction["plate"] + 3e-3 * rng.choice([-1, 1], body.model.mode_count)})
    takes = takes_of((body,))
    fresh = refit_material(stale, (body,), anew=True)
    lost = mean_db(takes, predict_takes(stale, takes)) - mean_db(takes, predict_takes(fresh, takes))
    assert lost > 3.0
    found = cross_validated(stale, posed((body,), takes, Idle), evidence_of(stale, (body,), BAND))
    assert [c.id for c in found] == ["mode-splitting"]
    assert np.abs(found[0].drop_db).max() < 0.1 * lost
    assert not is_accepted(found[0], lost)


@parametrize_few("spoils", [(0, 1, 2, 3, 4), (0, 1), ()], (1,), ids=["all", "two", "none"])
def test_what_gains_on_neither_of_the_loudest_is_asked_no_further(spoils: tuple[int, ...]) -> None:
    """Fitted without each of the two loudest, it says nothing of them, or plays them far worse."""

    class Mutes(Idle):
        id: ClassVar[str] = "mutes"
        stage: ClassVar[Stage] = Stage.SOUND
        traits: ClassVar[Traits] = Traits()

        def apply(self, x: Sound) -> Sound:
            return replace(x, sample=0.01 * x.sample) if x.strike in spoils else x

    body = recorded()
    takes, h = takes_of((body,)), refit_material(fitted(body), (body,))
    found = cross_validated(h, posed((body,), takes, Mutes), evidence_of(h, (body,), BAND))[0]
    loudest = sorted(np.argsort(-body.level_n_s, kind="stable")[:2].tolist())
    assert len(found.drop_db) == len(found.gap_db) == 2
    assert (found.drop_db < -3.0).tolist() == [i in spoils for i in loudest]
    assert not is_accepted(found, 1.0)


@pytest.mark.slow
def test_two_processes_find_what_one_finds(monkeypatch: pytest.MonkeyPatch) -> None:
    """Number for number."""
    body = recorded(AmplitudeDamping(5.0, "velocity"))
    h = refit_material(fitted(body), (body,))
    takes, evidence, kinds = (
        takes_of((body,)),
        evidence_of(h, (body,), BAND),
        (AmplitudeDamping, Radiation, Idle),
    )
    two = cross_validated(h, posed((body,), takes, *kinds, seed=3), evidence)
    monkeypatch.setattr("sonic_bullet.machine.parallel._can_fork", lambda: False)
    one = cross_validated(h, posed((body,), takes, *kinds, seed=3), evidence)
    assert len(one) >= 2
    assert [(c.id, c.effect.parameters(), c.control_db, c.spread) for c in two] == [
        (c.id, c.effect.parameters(), c.control_db, c.spread) for c in one
    ]
    assert all(np.array_equal(a.drop_db, b.drop_db) for a, b in zip(two, one, strict=True))


@pytest.mark.slow
def test_softer_strikes_tell_the_linear_modes_of_a_body_that_bends() -> None:
    body = recorded(BENT)
    assert body.recorded is not None
    soft = _soft(body.recorded, BAND)
    assert soft is not body.recorded and soft.lines.amplitude.shape[0] == len(body.recorded.recordings)
    chained = merge_line_chains(body.recorded.lines, LINKS[0])
    assert chained is not None

    def off(freq_hz: np.ndarray[Any, Any]) -> float:
        return float(np.median(np.abs(freq_hz[:, None] / plate().freq_hz - 1).min(axis=0)))

    assert off(soft.lines.freq_hz) < 1e-5 and off(chained.freq_hz) < 1e-5
    plain = recorded().recorded
    assert plain is not None and _soft(plain, BAND) is plain, "nothing bends there"
    level = tuple(replace(r, impulse_n_s=0.01) for r in body.recorded.recordings)
    alike = replace(body.recorded, recordings=level)
    assert _soft(alike, BAND) is alike, "none is softer"


def test_the_best_pairs_are_those_that_counting_through_finds() -> None:
    rng = np.random.default_rng(8)
    column, y = np.abs(rng.standard_normal((9, 14))), np.abs(rng.standard_normal(14))
    every = np.array(list(combinations(range(9), 2)))
    sets, strength, gain = _best(column @ column.T, column @ y, every)
    cost = {
        tuple(s): float(np.linalg.norm(y - column[list(s)].T @ nnls(column[list(s)].T, y)[0])) for s in every.tolist()
    }
    both = {s: c for s, c in cost.items() if (nnls(column[list(s)].T, y)[0] > 1e-9).all()}
    assert tuple(sets[0]) == min(both, key=both.__getitem__)
    assert gain[0] == pytest.approx(float(y @ y) - min(both.values()) ** 2)
    assert strength[0] == pytest.approx(nnls(column[sets[0]].T, y)[0], rel=1e-6)


@pytest.mark.slow
def test_three_weak_dashpots_are_told_together() -> None:
    """A thirtieth of the decays, where a law is good to a two-hundredth: no one says half of it, all three do."""
    fixture = SupportDamping(WEAK, (0.15, 0.1, 0.12))
    body = recorded(fixture, noise=2e-6)
    trial = DashpotFit.of(evidence_of(fitted(body), (body,), BAND).observed[0])
    grid = np.unique(trial.model.face)
    found = subsets(trial, grid[::7], 2)
    assert [len(s) for s in found] == [1, 1, 2, 2, 3, 3]
    least = [min(trial.left(s) for s in found if len(s) == size) for size in (1, 3)]
    assert least[1] < 0.5 * least[0] < 0.5 * trial.left(())
    told = _of(trial, min((s for s in found if len(s) == 3), key=trial.left))
    bare = replace(struck().model, decay_per_s=np.full(18, 5.0))
    # which takes up what a law of the material may
    law = np.linalg.qr(np.stack([np.ones(18), bare.freq_hz**2], axis=1))[0]
    true, made = (x.apply(bare).decay_per_s - 5.0 for x in (fixture, told))
    own, missed = (y - law @ (law.T @ y) for y in (true, made - true))
    assert np.linalg.norm(missed) < 0.5 * np.linalg.norm(own)


def test_trials_tell_what_has_numbers_of_single_lines_all_lines(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr("sonic_bullet.machine.parallel._can_fork", lambda: False)
    body = recorded()
    takes, h = takes_of((body,)), refit_material(fitted(body), (body,))
    asked: list[tuple[str, int]] = []

    class Listens(Idle):
        id: ClassVar[str] = "listens"
        traits: ClassVar[Traits] = Traits(by_line=True)
        stage: ClassVar[Stage] = Stage.FORCE

        @classmethod
        def propose(cls, evidence: Evidence) -> Self | None:
            asked.append((cls.id, len(evidence.observed[0].freq_hz)))
            return cls()

    class Part(Listens):
        id: ClassVar[str] = "part"
        traits: ClassVar[Traits] = Traits()

    class Searches(Listens):
        id: ClassVar[str] = "searches"
        traits: ClassVar[Traits] = Traits(by_line=True, cost=Cost.SEARCHES)

    told = evidence_of(h, (body,), BAND)
    count = len(told.observed[0].freq_hz)
    cross_validated(h, posed((body,), takes, Listens, Part, Searches), told)
    assert {n for who, n in asked if who in ("listens", "searches")} == {count}
    assert {n for who, n in asked if who == "part"} == {count, round(RULES.kept_lines_share * count)}


@parametrize_few(
    ("dry", "costly", "asked"),
    [(True, True, ["tensor"]), (False, True, ["support-damping", "tensor"]), (True, False, ["support-damping"])],
    2,
)
def test_in_a_room_dashpots_wait_for_a_tensor(
    dry: bool, costly: bool, asked: list[str], monkeypatch: pytest.MonkeyPatch
) -> None:
    """Lines that are paired with another material's modes tell little of what mixes these; asked alone, dashpots are
    sought.
    """
    monkeypatch.setattr("sonic_bullet.machine.parallel._can_fork", lambda: False)
    monkeypatch.setattr("sonic_bullet.lab.diagnosis.selection.cross_validation.modes_off_lines", lambda one: True)
    seen: list[str] = []

    class Dashpots(Idle):
        id: ClassVar[str] = "support-damping"
        traits: ClassVar[Traits] = SupportDamping.traits

        @classmethod
        def propose(cls, evidence: Evidence) -> Self | None:
            seen.append(cls.id)
            return None

    class Tensor(Idle):
        id: ClassVar[str] = "tensor"
        stage: ClassVar[Stage] = Stage.MATERIAL
        traits: ClassVar[Traits] = Traits(cost=Cost.COSTLY)

        @classmethod
        def propose(cls, evidence: Evidence) -> Self | None:
            seen.append(cls.id)
            return cls()

    body = recorded()
    takes, h = takes_of((body,)), refit_material(fitted(body), (body,))
    told = evidence_of(h, (body,), BAND)
    told = replace(told, observed=(replace(told.observed[0], dry=dry),))
    cross_validated(h, posed((body,), takes, Dashpots, Tensor), told, costly=costly)
    assert list(dict.fromkeys(seen)) == asked
    seen.clear()
    cross_validated(h, posed((body,), takes, Dashpots), told, costly=costly)
    assert seen == ["support-damping"]


def test_a_tensor_is_asked_where_modes_have_no_line_and_not_where_lines_have_no_mode() -> None:
    body = recorded()
    told = evidence_of(refit_material(fitted(body), (body,)), (body,), BAND).observed[0]
    assert not modes_off_lines(told)
    strange = np.linspace(told.freq_hz.min(), told.freq_hz.max(), 40)
    beside = replace(
        told,
        foreign_hz=strange,
        foreign_decay_per_s=np.ones(40),
        foreign_amplitude=np.ones((len(told.amplitude), 40), complex),
        foreign_sd=np.ones((len(told.amplitude), 40)),
    )
    assert not modes_off_lines(beside)
    off = 1 + 0.03 * np.where(np.arange(len(told.freq_hz)) % 2, 1, -1)
    assert modes_off_lines(replace(told, freq_hz=told.freq_hz * off))


@pytest.mark.slow
def test_dashpots_are_asked_after_a_tensor_that_came_to_nothing(monkeypatch: pytest.MonkeyPatch) -> None:
    asked: list[list[str]] = []
    room = Room(1.1, 0.7, 11)
    body = recorded(room)
    takes = takes_of((body,))

    def counted(h: Hypothesis, problem: Any, evidence: Any, **_: Any) -> list[Candidate]:
        asked.append([kind.id for kind in problem.effects])
        drop = np.full(len(takes), 5.0)
        if len(asked) == 1:
            found = propose_room(evidence_of(h, (body,), BAND))
            assert found is not None
            return [Candidate("room", found, refit_material(replace(h, effects=(found,)), (body,)), drop, 5.0, 0.0, {})]
        if len(asked) == 2:
            return [Candidate("tensor", Orthotropy((1.0,) * 9), h, -drop, -5.0, 0.0, {})]
        return [Candidate("support-damping", SupportDamping(((0.0, 0.0, 0.0),), (1.0,)), h, -drop, -5.0, 0.0, {})]

    monkeypatch.setattr(loop, "cross_validated", counted)
    anew: list[list[str]] = []
    monkeypatch.setattr(loop, "in_a_room", lambda _, found, *__, **___: anew.append([c.id for c in found]))
    monkeypatch.setattr(loop, "pairwise", lambda *_, **__: None)
    # however little the room leaves
    monkeypatch.setattr(loop, "RULES", replace(RULES, same_share=1e-9, little_share=1e-9))
    monkeypatch.setattr(loop, "is_open", lambda open_db, _: open_db >= RULES.least_drop_db)
    monkeypatch.setattr(loop, "reidentify_room", lambda h, *_, **__: h)  # which leaves less than noise does
    end = loop.select_effects(fitted(body), (body,), takes, EFFECTS, BAND)
    every = [kind.id for kind in EFFECTS]
    assert asked == [every, every, ["support-damping"]]
    assert anew == [["tensor"], ["support-damping"]], "the room is identified anew beside both"
    assert [c.id for c in end.added] == ["room"]


def test_a_lines_own_numbers_are_tried_with_all_lines() -> None:
    """Identified from no other line, but from the other strikes; the corrections that they are held against, too."""
    body = recorded()
    takes, h = takes_of((body,)), refit_material(fitted(body), (body,))
    told = evidence_of(h, (body,), BAND)
    count = len(told.observed[0].freq_hz)
    for keep in (RULES.kept_lines_share, 1.0):
        for i, fold in enumerate(_folds(h, posed((body,), takes), told, keep=keep)):
            less = fold.evidence.observed[0]
            assert len(less.freq_hz) == round(keep * count)
            assert less.impulse_n_s == pytest.approx(np.delete(told.observed[0].impulse_n_s, i))
