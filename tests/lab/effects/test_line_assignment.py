"""Pairs of lines and modes: shifts, decays, patterns and weights each decide where the others do not."""

from __future__ import annotations

import numpy as np
import pytest

from sonic_bullet.lab.effects.common.line_assignment import BEYOND_WIDTHS, assign_lines, cosines, weight_by_level

MODES = np.log(np.geomspace(300.0, 5000.0, 8))


def test_a_permutation_is_found_under_a_common_shift() -> None:
    order = np.random.default_rng(1).permutation(8)
    pairs = assign_lines(MODES[order] + 0.3, MODES, 0.004, shift=(0.3,))
    assert pairs.line.tolist() == list(range(8)) and pairs.mode.tolist() == order.tolist()
    assert pairs.price == pytest.approx(-8)
    assert not len(assign_lines(MODES[order] + 0.3, MODES, 0.004).line)


def test_a_line_as_many_widths_off_as_is_said_is_no_pair() -> None:
    width = 0.004
    for off, count in ((0.999, 1), (1.001, 0)):
        assert len(assign_lines(MODES[:1] + off * BEYOND_WIDTHS * width, MODES, width).line) == count


def test_decays_decide_between_modes_as_far_off_and_unknown_ones_do_not_count() -> None:
    width, modes = 0.004, MODES[:1] + np.array([-0.004, 0.004])
    decay = np.log(np.array([5.0, 50.0]))
    for own, mode in ((4.0, 0), (60.0, 1)):
        pairs = assign_lines(MODES[:1], modes, width, log_decay=(np.log([own]), decay), decay_width=0.4)
        assert pairs.mode.tolist() == [mode]
    unknown = assign_lines(MODES[:1], modes, width, log_decay=(np.array([np.nan]), decay), decay_width=0.4)
    assert unknown.price == pytest.approx(assign_lines(MODES[:1], modes, width).price)


def test_patterns_decide_between_modes_as_far_off() -> None:
    modes, shape = MODES[:1] + np.array([-0.004, 0.004]), np.array([[1.0, 0.2], [0.1, 1.0], [0.4, -1.0]])
    for k in range(2):
        pairs = assign_lines(MODES[:1], modes, 0.004, likeness=cosines(shape[:, k : k + 1], shape))
        assert pairs.mode.tolist() == [k]


def test_the_louder_line_has_the_mode_that_two_would_have_and_one_of_no_weight_none() -> None:
    weight = weight_by_level(np.array([1.0, 0.01]))
    assert weight.tolist() == [1.0, 0.5]
    lines = MODES[:1] + np.array([0.004, 0.003])
    assert assign_lines(lines, MODES, 0.004, weight=weight[:, None]).line.tolist() == [0]
    assert not len(assign_lines(lines, MODES, 0.004, weight=0.0).line)


def test_of_lines_that_stay_few_may_go_far() -> None:
    """Cauchy's law sends one line as far as is said; the square's would send it nowhere."""
    gone = MODES.copy()
    gone[3] += 0.04
    for farthest, count in ((0.06, 8), (0.03, 7), (None, 7)):
        assert len(assign_lines(gone, MODES, 0.002, farthest=farthest).line) == count
    either = assign_lines(gone, MODES, 0.002, shift=(0.0, 0.04))
    assert either.price == pytest.approx(-8)


def test_cosines_are_one_of_multiples_and_none_of_silence() -> None:
    a = np.array([[1.0, 0.0, 0.0], [1j, 2.0, 0.0]])
    assert cosines(a, -3 * a.conj()).diagonal() == pytest.approx([1.0, 1.0, 0.0])
