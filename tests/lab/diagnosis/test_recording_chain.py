"""Modes that depend on their own level come as chains of lines; what they end as is read off each chain."""

from __future__ import annotations

import numpy as np
import pytest

from sonic_bullet.effects import Effect
from sonic_bullet.effects.amplitude_damping import AmplitudeDamping
from sonic_bullet.effects.amplitude_pitch import AmplitudePitch
from sonic_bullet.effects.room import Room
from sonic_bullet.lab.diagnosis.evidence.effect_evidence import evidence_of
from sonic_bullet.lab.diagnosis.evidence.recording_chain import LINKS, chains, merge_line_chains
from sonic_bullet.lab.diagnosis.evidence.refit import refit_material
from sonic_bullet.lab.effects.amplitude_pitch import propose_amplitude_pitch
from sonic_bullet.lab.lines.joint_lines import Lines
from sonic_bullet.records import Array
from tests.few_cases import parametrize_few
from tests.lab.diagnosis.test_found_again import BAND, fitted
from tests.made.body import ALPHA, BETA, plate, recorded, struck

BENT = AmplitudePitch(0.08, "velocity")
CHOKED = AmplitudeDamping(5.0, "velocity")


def lines_of(*effects: Effect) -> Lines:
    body = recorded(*effects)
    assert body.recorded is not None
    return body.recorded.lines


def true_decay(freq_hz: Array) -> Array:
    """Of the plate's mode nearest to each, in 1/s."""
    own = plate().freq_hz
    at = np.abs(own[:, None] - freq_hz).argmin(axis=0)
    return np.asarray((ALPHA + BETA * (2 * np.pi * own[at]) ** 2) / 2)


@parametrize_few("link", LINKS, 1)
def test_a_bent_mode_is_one_line_with_the_decay_it_has(link: tuple[float, float, bool]) -> None:
    lines = lines_of(BENT)
    assert len(lines.freq_hz) > 1.3 * len(plate().freq_hz)
    one = merge_line_chains(lines, link)
    assert one is not None and len(one.freq_hz) < 0.8 * len(lines.freq_hz)
    loud = np.abs(one.amplitude).max(axis=0) > 0.02 * np.abs(one.amplitude).max()
    off = np.abs(one.decay_per_s / true_decay(one.freq_hz) - 1)[loud]
    assert np.median(off) < 0.03 and off.max() < 0.2
    before = np.abs(lines.decay_per_s / true_decay(lines.freq_hz) - 1)
    assert np.quantile(before, 0.6) > 0.2


def test_a_choked_mode_ends_with_its_own_decay() -> None:
    lines = lines_of(CHOKED)
    one = merge_line_chains(lines, LINKS[0])
    assert one is not None
    assert np.median(np.abs(one.decay_per_s / true_decay(one.freq_hz) - 1)) < 0.1


def test_chains_add_up_to_what_was_struck() -> None:
    body, plain = recorded(BENT), recorded()
    assert body.recorded is not None and plain.recorded is not None
    one, own = merge_line_chains(body.recorded.lines, LINKS[1]), plain.recorded.lines
    assert one is not None
    # nearer ones lend each other lines
    apart = np.array([np.sort(np.abs(own.freq_hz / f - 1))[1] > 0.02 for f in own.freq_hz])
    assert apart.sum() >= 12
    for k in np.flatnonzero(apart):
        near = int(np.argmin(np.abs(one.freq_hz / own.freq_hz[k] - 1)))
        struck_with = np.abs(own.amplitude[:, k])
        assert np.abs(one.amplitude[:, near]) == pytest.approx(
            struck_with, rel=0.03, abs=0.01 * float(struck_with.max())
        )


@pytest.mark.slow
def test_no_chains_where_no_level_counts() -> None:
    """In a room the wider links find some; what they play is farther from the recordings, which is for the baseline to
    see.
    """
    assert all(merge_line_chains(lines_of(), link) is None for link in LINKS)
    assert merge_line_chains(lines_of(Room(0.9, 0.8, 11)), LINKS[0]) is None


def test_every_line_is_in_one_group() -> None:
    lines = lines_of(BENT)
    for link in LINKS:
        groups = chains(lines, link)
        assert sorted(np.concatenate(groups).tolist()) == list(range(len(lines.freq_hz)))
        assert all((np.diff(lines.decay_per_s[g]) >= 0).all() for g in groups)


@parametrize_few("measure", ["velocity", "displacement"], 1)
def test_the_bend_and_its_measure_are_read_off_the_modes_that_show_it(measure: str) -> None:
    """By displacement only the lowest modes bend; the others say nothing for or against it."""
    true = AmplitudePitch(0.08 if measure == "velocity" else 2.0e6, measure)
    body = recorded(true)
    assert body.recorded is not None
    one = merge_line_chains(body.recorded.lines, LINKS[1]) or body.recorded.lines
    again = struck(lines=one, signals=body.recorded.signals)
    found = propose_amplitude_pitch(evidence_of(refit_material(fitted(again), (again,)), (again,), BAND))
    assert found is not None and found.measure == measure
    assert found.bend == pytest.approx(true.bend, rel=0.1)


def test_two_slow_lines_are_two_modes_though_a_chain_lies_between() -> None:
    """A pair that hardens passes its neighbour; as one group it would lose that line, and a mode would be put on the
    other.
    """
    freq = np.array([3430.4, 3430.9, 3436.0, 3444.7, 3450.0])
    decay = np.array([4.8, 5.0, 12.0, 4.9, 20.0])
    amplitude, sd, n = np.ones((3, 5), complex), np.full(5, 0.01), np.full(3, 1e-5)
    groups = chains(
        Lines(freq, decay, amplitude, sd, sd, np.full(amplitude.shape, 1e-3), n, np.full(5, 1e3), True), LINKS[1]
    )
    assert sorted(sorted(g.tolist()) for g in groups) == [[0, 1, 2], [3, 4]]


@pytest.mark.parametrize(
    ("links", "louder", "step", "one"),
    [(2, 2, 1, False), (3, 2, 1, False), (4, 0.5, 1, False), (4, 2, -1, False), (4, 2, 1, True)],
)
def test_one_long_chain_will_do(links: int, louder: float, step: int, one: bool) -> None:
    """Of a body of which only the lowest mode is struck hard enough to bend; two or three lines together may be
    neighbours, a room has many that are soft, and a chain's links go one way. Neighbours elsewhere stay two."""
    freq = np.concatenate([900.0 + step ** np.arange(links) * np.arange(links), [2100.0, 2101.0, 3300.0, 4700.0]])
    decay = np.concatenate([6.0 * 1.9 ** np.arange(links), [10.0, 20.0, 40.0, 70.0]])
    amplitude, sd, n = (
        np.where(freq < 1000, louder, 1.0) * np.ones((3, 1), complex),
        np.full(len(freq), 0.01),
        np.full(3, 1e-5),
    )
    found = merge_line_chains(
        Lines(freq, decay, amplitude, sd, sd, np.full(amplitude.shape, 1e-3), n, np.full(len(freq), 1e3), True),
        LINKS[0],
    )
    assert (found is not None) == one
    if found is not None:
        assert found.freq_hz == pytest.approx([900.0, 2100.0, 2101.0, 3300.0, 4700.0])
        assert found.amplitude[:, 0] == pytest.approx(links * louder * np.ones(3))
