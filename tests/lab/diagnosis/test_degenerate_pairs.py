"""A lone mode beside a pair, by accident: two lines show what a mesh leaves as one."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest

from sonic_bullet.lab.diagnosis.evidence.degenerate_pairs import separate_pairs
from sonic_bullet.lab.diagnosis.prediction.struck_bodies import StruckBody
from sonic_bullet.records import ModalModel
from tests.few_cases import parametrize_few
from tests.made.body import plate, recorded

GROUP = [3, 4, 5]


def beside(apart: float) -> ModalModel:
    """The plate with three modes at one frequency, the last so far from the pair."""
    model = plate()
    freq = model.freq_hz.copy()
    freq[GROUP] = freq[4] * np.array([1, 1, 1 + apart])
    return replace(model, freq_hz=freq)


def meshed(apart: float) -> StruckBody:
    """Recorded where the lone mode is ``apart`` from the pair, told by a mesh that leaves it 1e-4 from it: one line for
    all three.
    """
    body = recorded(model=beside(apart), seconds=1.2)
    assert body.recorded is not None
    line = body.line.copy()
    line[GROUP] = int(np.abs(body.recorded.lines.freq_hz / beside(apart).freq_hz[GROUP[0]] - 1).argmin())
    model = beside(1e-4)
    return replace(body, model=model, line=line, correction=np.zeros(len(line)))


@pytest.mark.slow
@parametrize_few("apart", [0.005, 0.008], 1)
def test_two_lines_part_a_group_of_three(apart: float) -> None:
    body = meshed(apart)
    told = separate_pairs(body)
    assert told.recorded is not None
    lines = told.recorded.lines.freq_hz
    own = beside(apart).freq_hz[GROUP]
    assert lines[told.line[GROUP]] == pytest.approx(own, rel=2e-4)
    assert told.model.freq_hz[GROUP] * (1 + told.correction[GROUP]) == pytest.approx(own, rel=2e-4)
    rest = np.setdiff1d(np.arange(len(told.line)), GROUP)
    assert (told.line[rest] == body.line[rest]).all()


@pytest.mark.slow
def test_what_no_second_line_shows_stays_one() -> None:
    body = meshed(0.0)
    assert separate_pairs(body) is body


@pytest.mark.slow
def test_lines_unlike_the_modes_part_nothing() -> None:
    body = meshed(0.006)
    assert body.recorded is not None
    lines = body.recorded.lines
    turned = np.roll(lines.amplitude, 1, axis=0)
    assert (
        separate_pairs(
            replace(body, recorded=replace(body.recorded, lines=replace(lines, amplitude=turned)))
        ).line.tolist()
        == body.line.tolist()
    )


def test_of_two_alone_nobody_can_say() -> None:
    body = meshed(0.006)
    line = body.line.copy()
    line[GROUP[0]] = -1
    pair = replace(body, line=line)
    assert separate_pairs(pair) is pair
