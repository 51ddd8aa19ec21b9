"""Dashpots beyond first order: pairs that turn, neighbours that mix, points that are held; and the way back from lines
to the dashpots.
"""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest
from scipy.linalg import expm

from sonic_bullet.effects.common.dashpots import couple_modes, damp_model
from sonic_bullet.effects.damping_law import DampingLaw
from sonic_bullet.effects.support_damping import SupportDamping
from sonic_bullet.lab.diagnosis.evidence.effect_evidence import evidence_of
from sonic_bullet.lab.diagnosis.prediction.prediction import came_from, predict
from sonic_bullet.lab.effects.common.dashpots import split_into_runs
from sonic_bullet.lab.effects.damping_law import propose_damping_law
from sonic_bullet.lab.effects.support_damping import propose_support_damping
from sonic_bullet.lab.effects.support_damping.dashpot_fit import (
    LINE_LEVEL_ERROR,
    MISSED_COST,
    SILENT_MODE_COST,
    Dashpot,
    DashpotFit,
)
from sonic_bullet.lab.effects.support_damping.support_search import search_dashpots
from sonic_bullet.records import Array, ModalModel
from tests.few_cases import parametrize_few
from tests.made.body import GAIN, plate, recorded, truth

LEAST = 0.02

SPOT, OTHER = (0.0477, 0.0371, 0.0), (0.0955, 0.0186, 0.0)
BAND = (50.0, 7_500.0)


def test_a_mode_that_should_be_heard_and_is_not_costs_something() -> None:
    body = recorded()
    t = DashpotFit.of(evidence_of(truth(), (body,), BAND).observed[0])
    loud = 1 + int(np.argmax(np.abs(t.size[:, 1:-1]).max(axis=0)))  # between two others: beyond them nobody listens
    rest = np.delete(np.arange(len(t.freq_hz)), loud)
    fewer = replace(
        t,
        freq_hz=t.freq_hz[rest],
        decay_per_s=t.decay_per_s[rest],
        sd=t.sd[rest],
        size=t.size[:, rest],
        worth=t.worth[rest],
    )
    keep = np.abs(t.observed_hz - t.freq_hz[loud]) > 1e-6
    deaf = replace(fewer, observed_hz=t.observed_hz[keep], rings_per_s=t.rings_per_s[keep])
    # the two differ in whether a line is there, one that is held against no mode
    assert deaf.left(()) - fewer.left(()) > 0.8 * SILENT_MODE_COST
    unknown = replace(fewer, rings_per_s=np.where(keep, t.rings_per_s, np.nan))
    assert unknown.left(()) == fewer.left(()), "a line of unknown decay may hide it"

    def missed(**what: object) -> float:
        return replace(deaf, **what).left(()) - replace(fewer, **what).left(())  # type: ignore[arg-type]

    assert missed(through=np.where(np.abs(deaf.model.freq_hz - t.freq_hz[loud]) < 1, 1e-3, deaf.through)) == 0, (
        "the pulse leaves nothing of it"
    )
    quick = deaf.model.decay_per_s.copy()
    quick[np.abs(deaf.model.freq_hz - t.freq_hz[loud]).argmin()] *= 100
    assert missed(model=replace(deaf.model, decay_per_s=quick)) == 0, "what dies at once is not missed"


@pytest.mark.slow
def test_a_faint_line_far_above_does_not_hide_a_dashpot() -> None:
    body = recorded(SupportDamping((SPOT,), (3.0,)))
    observed = evidence_of(truth(), (body,), BAND).observed[0]
    low = observed.freq_hz < 3_500
    one = replace(
        observed,
        **{
            name: getattr(observed, name)[low]
            for name in ("freq_hz", "decay_per_s", "freq_sd_hz", "decay_sd_per_s", "model_hz", "expected_decay_per_s")
        },
        **{name: getattr(observed, name)[:, low] for name in ("amplitude", "amplitude_sd", "expected", "pattern")},
        mode=tuple(m for m, there in zip(observed.mode, low, strict=True) if there),
        foreign_hz=np.array([7_000.0]),
        foreign_decay_per_s=np.array([40.0]),
        foreign_amplitude=np.full((len(observed.amplitude), 1), 1e-3 * np.abs(observed.amplitude).max()),
        foreign_sd=np.zeros((len(observed.amplitude), 1)),
    )
    found = search_dashpots(DashpotFit.of(one))
    assert [d.c for d in found] == [pytest.approx(3.0, rel=0.15)]


def test_a_line_louder_than_its_mode_counts_as_one_of_another_decay_does() -> None:
    """All strikes alike: a pattern's cosine sees nothing of it.

    What is common to all lines is a gain, and says nothing.
    """
    t = DashpotFit.of(evidence_of(truth(), (recorded(),), BAND).observed[0])
    one = np.where(np.arange(len(t.freq_hz)) == 3, 10.0, 1.0)
    by_hand = MISSED_COST * np.log1p((np.log(10) / LINE_LEVEL_ERROR) ** 2 / MISSED_COST)
    changed = replace(t, size=t.size * one)
    assert changed.left(()) - t.left(()) == pytest.approx(t.worth[3] * by_hand, rel=0.05, abs=0.5)
    assert replace(t, size=10 * t.size).left(()) == pytest.approx(t.left(()))


def some(c: float) -> tuple[Array, Array, Array, Array]:
    """λ, own decays, √c φ of one dashpot, and its damping matrix: four modes, two of them near each other."""
    lam = (2 * np.pi * np.array([300.0, 520.0, 527.0, 900.0])) ** 2
    own = np.array([4.0, 6.0, 6.0, 9.0])
    phi = np.sqrt(c) * np.array([[1.1, -2.0, 1.4, 2.2]])
    return lam, own, phi, phi.T @ phi + np.diag(2 * own)


def paired_plate() -> ModalModel:
    """The plate with its third and fourth mode at one frequency, as a square one has them."""
    x = plate()
    freq = x.freq_hz.copy()
    freq[[2, 3]] = freq[[2, 3]].mean()
    return replace(x, freq_hz=freq, decay_per_s=np.full(len(freq), 5.0))


@parametrize_few("c", [1.0, 40.0, 300.0], (1,))
def test_poles_and_turns_are_the_equation_solved(c: float) -> None:
    """Σ (b·q)(c·q)(1 + id/ω) e^{st} is the velocity after an impulse, by the matrix exponential."""
    lam, own, phi, loss = some(c)
    found = couple_modes(lam, own, phi)
    into, out = np.array([1.0, 0.4, -0.7, 0.9]), np.array([0.8, -1.0, 0.5, 0.6])
    state = np.block([[np.zeros((4, 4)), np.eye(4)], [-np.diag(lam), -loss]])
    alive = np.isfinite(found.pole)
    s, q = found.pole[alive], found.turn[:, alive]
    for t in (0.004, 0.011, 0.03):  # later than what no longer swings
        true = np.concatenate([np.zeros(4), out]) @ expm(state * t) @ np.concatenate([np.zeros(4), into])
        told = ((into @ q) * (out @ q) * (1 - 1j * s.real / s.imag) * np.exp(s * t)).real.sum()
        assert told == pytest.approx(true, rel=1e-4, abs=1e-4)


def test_a_weak_dashpot_adds_half_c_phi_squared_and_all_of_them_keep_the_trace() -> None:
    lam, own, phi, _ = some(1e-3)
    assert np.allclose(-couple_modes(lam, own, phi).pole.real - own, 0.5 * phi[0] ** 2, rtol=1e-3)
    lam, own, phi, loss = some(8.0)
    assert -2 * couple_modes(lam, own, phi).pole.real.sum() == pytest.approx(np.trace(loss), rel=1e-9)


def test_a_strong_dashpot_holds_its_point() -> None:
    """Decays fall again, one mode no longer swings, and what is left stands still there: Rayleigh's constraint."""
    lam, own, phi, _ = some(1e7)
    found = couple_modes(lam, own, phi)
    alive = np.isfinite(found.pole)
    assert alive.sum() == 3
    assert np.abs(phi @ found.turn[:, alive]).max() < 1e-2 * np.abs(phi).max()
    assert (-found.pole.real[alive] < 1.1 * own.max()).all()
    freq = np.sort(found.pole.imag[alive]) / (2 * np.pi)
    assert ((freq > [300, 520, 527]) & (freq < [520, 527, 900])).all(), "between the free ones [Rayleigh 1894, § 92a]"


def test_a_pair_turns_to_the_dashpot() -> None:
    """One of the two takes all of it, the other stands still at the point and keeps its decay."""
    x = paired_plate()
    made = SupportDamping((SPOT,), (0.3,)).apply(x)
    vertex = int(np.argmin(((x.vertex_m[:345] - np.array(SPOT)) ** 2).sum(axis=1)))
    at = np.sort(np.abs(made.shape[vertex, 2, [2, 3]]))
    total = float((x.shape[vertex, 2, [2, 3]].astype(float) ** 2).sum())
    assert at[0] < 0.02 * at[1]
    assert np.allclose(np.sort(made.decay_per_s[[2, 3]] - 5.0), [0.0, 0.15 * total], rtol=2e-2, atol=1e-2)


def test_modes_that_change_places_are_known_again() -> None:
    x = paired_plate()
    order = np.array([1, 0, *range(2, 18)])
    assert (came_from(x, replace(x, shape=-x.shape[:, :, order])) == order).all()
    strong = damp_model(x, 30 * x.shape[100, 2:].astype(float))
    assert strong.mode_count == x.mode_count
    assert np.isfinite(strong.shape).all()


def test_runs_are_cut_where_frequencies_lie_apart() -> None:
    runs = split_into_runs(np.array([1.0, 1.01, 1.02, 2.0, 2.01, 2.02, 2.03, 4.0]), 4)
    assert [run.tolist() for run in runs] == [[0, 1, 2], [3, 4, 5, 6], [7]]
    assert max(len(run) for run in split_into_runs(np.linspace(1, 2, 57), 10)) <= 10


@pytest.mark.slow
@parametrize_few(
    "law",
    [DampingLaw("constant-loss", 6e-3), DampingLaw("relaxation", 5e-4, strength=0.03, tau_s=3e-5)],
    1,
    ids=lambda e: str(e.law),
)
def test_two_dashpots_are_read_off_pairs_beside_a_law_that_is_not_rayleighs(law: DampingLaw) -> None:
    """Their places, but for the plate's own mirrors, and strengths within a fifth; a relaxation's decays level off,
    which no power series of ω above zero does.
    """
    body = recorded(
        law, SupportDamping((SPOT, OTHER), (7.0, 7.0)), model=replace(paired_plate(), decay_per_s=np.zeros(18))
    )
    found = propose_support_damping(evidence_of(replace(truth(), gain=GAIN), (body,), BAND))
    assert found is not None
    assert len(found.position_m) == 2
    for place in (SPOT, OTHER):
        folded = [(min(p[0], 0.21 - p[0]), min(p[1], 0.13 - p[1]), 0.0) for p in found.position_m]
        off = [float(np.linalg.norm(np.subtract(p, place))) for p in folded]
        assert min(off) < 0.015
        assert found.strength_n_s_m[int(np.argmin(off))] == pytest.approx(7.0, rel=0.2)


def test_a_law_of_the_material_is_read_beside_dashpots_and_acts_under_them() -> None:
    fixture, law = SupportDamping((SPOT, OTHER), (7.0, 7.0)), DampingLaw("constant-loss", 6e-3)
    body = recorded(law, fixture)
    found = propose_damping_law(evidence_of(truth(fixture), (body,), BAND))
    assert found is not None
    assert found.law == "constant-loss"
    assert found.eta == pytest.approx(6e-3, rel=0.02)
    one, two = (predict(truth(*order), body).model for order in ((law, fixture), (fixture, law)))
    assert np.array_equal(one.decay_per_s, two.decay_per_s), "whichever was found first"


def test_a_dashpot_that_does_nothing_is_none(monkeypatch: pytest.MonkeyPatch) -> None:
    """Beside whatever moves modes twins keep corrections of their own, which gains something where a mesh is off: that
    is no dashpot's.
    """
    told = evidence_of(truth(), (recorded(),), BAND)
    x = told.observed[0].model
    assert x is not None
    vertex = int((x.shape[: len(np.unique(x.face)), 2].astype(float) ** 2).sum(axis=1).argmax())
    for share, named in ((0.5 * LEAST, False), (2.0 * LEAST, True)):
        c = (
            2 * share * float((x.decay_per_s / np.maximum(x.shape[vertex, 2].astype(float) ** 2, 1e-30)).min())
        )  # ½ c φ² = share · d, of the mode it takes most of
        monkeypatch.setattr(
            "sonic_bullet.lab.effects.support_damping.search_dashpots", lambda _, c=c: (Dashpot(vertex, c, "every"),)
        )
        assert (propose_support_damping(told) is not None) is named
