"""What changed between two states of made plates: named, with its numbers; and nothing where nothing changed."""

from __future__ import annotations

from dataclasses import replace
from functools import cache

import numpy as np
import pytest

from sonic_bullet.lab.lines.onset import span
from sonic_bullet.lab.states.chance import CERTAIN, judge, labelling_count, labellings
from sonic_bullet.lab.states.changes import Changes, StateValues, compare_states, values_of
from sonic_bullet.lab.states.contact_pulses import fit_contacts
from sonic_bullet.lab.states.line_pairs import uncross_partners
from sonic_bullet.lab.states.recorded_states import RecordedState, take_of
from sonic_bullet.lab.states.state_causes import find_causes, shifts
from sonic_bullet.lab.states.state_series import find_series, predict_by_law
from sonic_bullet.lab.states.take_lines import signals_of
from sonic_bullet.lab.states.take_prediction import predict
from tests.few_cases import parametrize_few
from tests.lab.states.made_takes import Plate, modes_of, state, take

PLATE = Plate(highest_hz=5000.0)


@cache
def before() -> StateValues:
    """Six takes of the plate as it is."""
    return values_of(state("before", PLATE, 6, 1))


def compared(seed: int = 2, **change: object) -> Changes:
    """Six takes of the plate changed, against the plate as it was."""
    return compare_states(before(), values_of(state("after", PLATE, 6, seed, **change)))


def test_nothing_is_said_of_takes_of_one_state() -> None:
    found = compared()
    assert found.method == "exchange" and len(found.rows) > 30
    assert not found.anything and find_causes(found) == ()


def test_a_mass_is_named_with_the_shifts_it_makes() -> None:
    found = compared(mass=0.03)
    (cause,) = find_causes(found)
    assert (cause.name, cause.of_the_thing) == ("added-mass", True) and "lost-stiffness" in cause.alternatives
    freq = modes_of(PLATE)[0]
    first = min(shifts(found), key=lambda row: row.freq_hz)
    assert first.before == pytest.approx(freq[0], rel=1e-4) and -3.5 < first.change < -1.5
    told = predict(found, (cause,))
    assert told is not None and told.gap_closed > 0.8 and told.after_db < told.before_db


def test_damping_is_named_with_its_t60_ratio() -> None:
    found = compared(alpha_per_s=15.0)
    (cause,) = find_causes(found)
    assert cause.name == "damping"
    _, decay, _ = modes_of(PLATE)
    lowest = next(row for row in found.of("octave T60") if row.freq_hz == 250)
    assert lowest.change == pytest.approx(decay[0] / (decay[0] + 6.0), rel=0.15)  # Δd = (15 − 3)/2
    told = predict(found, (cause,))
    assert told is not None and told.gap_closed > 0.5 and told.gap_low > 0


@pytest.mark.slow
def test_less_of_a_damping_that_grows_with_frequency_is_predicted_from_where_it_was_loudest() -> None:
    damped = values_of(state("damped", replace(PLATE, alpha_per_s=25.0, beta_s=1e-6), 5, 1))
    free = values_of(state("free", replace(PLATE, alpha_per_s=4.0, beta_s=2e-7), 5, 2))
    found = compare_states(damped, free)
    (cause,) = find_causes(found)
    told = predict(found, (cause,))
    assert cause.name == "less-damping" and told is not None and told.gap_closed > 0.6


@parametrize_few(
    ("change", "name", "of_the_thing"),
    [
        ({"contact_s": 1e-3}, "contact-time", False),
        ({"rings_along": (0.5, 2440.0, 0.8)}, "foreign-mode", True),
        ({"stretch": 1.02}, "stiffness", True),
        ({"room": (0.5, 0.6)}, "room", False),
        ({"mass": 0.004}, "added-mass", True),
        ({"dashpot_per_s": 8.0}, "damping", True),
    ],
    1,
)
def test_one_change_one_name(change: dict[str, object], name: str, of_the_thing: bool) -> None:
    causes = find_causes(compared(**change))
    assert [one.name for one in causes] == [name] and causes[0].of_the_thing is of_the_thing


@parametrize_few(
    ("other", "name", "loss"),
    [
        (replace(PLATE, stretch=1.25, room=(0.5, 0.4)), "stiffness", None),
        (replace(PLATE, stretch=0.7, alpha_per_s=40.0, beta_s=3e-6), "material", 18.0),
    ],
    1,
)
def test_a_spectrum_that_goes_far_by_one_factor_is_size_or_with_its_loss_a_material(
    other: Plate, name: str, loss: float | None
) -> None:
    plain = values_of(state("before", replace(PLATE, room=other.room), 5, 1))
    found = compare_states(plain, values_of(state("after", other, 5, 2)))
    assert found.shift is not None and np.exp(found.shift.log_factor) == pytest.approx(other.stretch, rel=0.01)
    (cause,) = find_causes(found)
    assert cause.name == name and cause.of_the_thing
    assert loss is None or cause.numbers["loss_factor_ratio"] == pytest.approx(loss, rel=0.3)
    told = predict(found, (cause,))
    assert told is not None and told.gap_closed > 0.5


@parametrize_few(
    ("other", "name"),
    [({"room": (0.7, 0.35), "echoes": 8}, "room"), ({"contact_s": 1.2e-3}, "contact-time")],
    1,
)
def test_in_a_room_another_room_pulls_lines_either_way_and_another_striker_none(
    other: dict[str, object], name: str
) -> None:
    inside = replace(PLATE, room=(0.7, 0.5))
    found = compare_states(values_of(state("before", inside, 5, 1)), values_of(state("after", inside, 5, 2, **other)))
    (cause,) = find_causes(found)
    assert cause.name == name and not cause.of_the_thing


def test_another_place_of_the_strike_is_no_change_of_the_thing() -> None:
    causes = find_causes(compared(strike=(0.2, 0.17)))
    assert not any(one.of_the_thing for one in causes)


def test_a_longer_contact_is_seen_in_all_lines_at_once_and_with_its_durations() -> None:
    found = compared(contact_s=4e-4)
    (cause,) = find_causes(found)
    assert cause.name == "contact-time" and not cause.of_the_thing and "strike-place" in cause.alternatives
    assert cause.numbers["contact_after_s"] / cause.numbers["contact_before_s"] == pytest.approx(4 / 3, rel=0.1)
    assert len(found.of("line level")) < 0.5 * len(found.of("line level", certain=False))  # few are certain alone


def test_levels_line_by_line_are_no_contact() -> None:
    fit = fit_contacts(compared(strike=(0.2, 0.17)))
    assert fit.chance > CERTAIN or not fit.explains


def test_other_modes_are_a_class_with_all_that_makes_them() -> None:
    other = replace(PLATE, size=(0.33, 0.30), lowest_hz=365.0)  # by factors of their own, 0.97 to 1.4
    found = compare_states(before(), values_of(state("after", other, 6, 2)))
    (cause,) = find_causes(found)
    assert cause.name == "other-modes" and {"wall-thickness", "material"} <= set(cause.alternatives)
    assert cause.separated_by


def test_lines_that_only_went_are_no_other_place() -> None:
    plate = replace(PLATE, lowest_hz=700.0, highest_hz=9000.0, contact_s=1.5e-4)
    muffled = replace(plate, filter_db=(-60.0, 300.0))  # below the noise, as a fingertip leaves them
    found = compare_states(values_of(state("before", plate, 5, 1)), values_of(state("after", muffled, 5, 2)))
    (cause,) = find_causes(found)
    assert cause.name == "contact-time" and not cause.of_the_thing
    assert {"measurement-chain", "damping-law"} <= set(cause.alternatives) and "strike-place" not in cause.alternatives


@pytest.mark.slow
@pytest.mark.parametrize("seed", range(12))
def test_wherever_it_is_struck_nothing_is_said_of_the_thing_alone(seed: int) -> None:
    rng = np.random.default_rng(seed)
    strike = tuple(np.array(PLATE.size) * rng.uniform(0.05, 0.95, 2))
    for cause in find_causes(compared(seed=2 + seed, strike=strike)):
        assert not cause.of_the_thing or "strike-place" in cause.alternatives


def test_a_rumble_before_the_strike_is_not_the_strike() -> None:
    sr, at_s = 24_000, 1 / 7
    t = np.arange(round((1 + at_s) * sr)) / sr
    strike = np.exp(-12 * (t - at_s)) * np.sin(2 * np.pi * 900 * (t - at_s)) * (t >= at_s)
    rumble = 0.25 * np.exp(-(((t - 0.06) / 0.012) ** 2)) * np.sin(2 * np.pi * 25 * t)
    signal = strike + rumble + 1e-3 * np.random.default_rng(0).standard_normal(len(t))
    assert span(signal, sr).start < 0.05 * sr  # 99 ms before the strike: too little to be a take
    assert len(take_of(signal, sr, "rumble").signal) == pytest.approx(sr, abs=0.01 * sr)


def test_two_takes_are_too_few() -> None:
    one, other = (values_of(state(name, PLATE, 1, seed)) for name, seed in (("a", 3), ("b", 4)))
    found = compare_states(one, other)
    assert found.method == "too few takes" and not found.anything


def test_exchange_counts_every_labelling_and_errs_as_seldom_as_it_says() -> None:
    assert (labelling_count(5, 5), labelling_count(4, 4), labelling_count(6, 8)) == (126, 35, 3003)
    after = np.repeat([False, True], [5, 5])
    assert len(np.unique(labellings(after), axis=0)) == 252
    rng = np.random.default_rng(0)
    kind, own = np.repeat(["a", "b"], 10), np.full(20, 0.1)
    wrong = sum(judge(rng.standard_t(3, (20, 10)), after, kind, own).certain.any() for _ in range(100))
    assert wrong / 100 < 3 * CERTAIN
    values = rng.standard_normal((20, 10))
    values[3, 5:] += 12
    assert np.flatnonzero(judge(values, after, kind, own).certain).tolist() == [3]


def test_by_scatter_one_way_at_most_to_divide_eight_takes_says_anything() -> None:
    rng = np.random.default_rng(1)
    kind, own = np.repeat(["a", "b"], 20), np.full(40, 0.1)
    wild = rng.standard_t(1.5, (40, 8))  # tails far longer than a normal law's
    wild[7, :4] += 40  # and one way that does differ, as takes of two strengths do
    said = [
        labels.tolist()
        for labels in labellings(np.repeat([False, True], [4, 4]))
        if judge(wild, labels, kind, own).certain.any() and not labels[0]
    ]
    assert len(said) <= 1
    values = rng.standard_normal((40, 8))
    values[3, 4:] += 25
    found = judge(values, np.repeat([False, True], [4, 4]), kind, own)
    assert found.method == "scatter" and np.flatnonzero(found.certain).tolist() == [3]


@pytest.mark.parametrize(("pairs", "method"), [(4, "scatter"), (8, "exchange")])
def test_strikes_recorded_twice_tell_what_single_takes_hide(pairs: int, method: str) -> None:
    rng = np.random.default_rng(2)
    kind, own, after = np.repeat(["a", "b"], 20), np.full(40, 0.1), np.repeat([False, True], pairs)
    strike = 10 * rng.standard_normal((40, pairs))
    values = np.concatenate([strike, strike], axis=1) + rng.standard_normal((40, 2 * pairs))
    assert not judge(values, after, kind, own, paired=True).certain.any()
    values[3, pairs:] += 12
    found = judge(values, after, kind, own, paired=True)
    assert found.method == method and np.flatnonzero(found.certain).tolist() == [3]
    assert not judge(values, after, kind, own).certain.any()
    three = np.repeat([False, True], [3, 3])
    assert judge(values[:, [0, 1, 2, pairs, pairs + 1, pairs + 2]], three, kind, own, paired=True).method.startswith(
        "too"
    )


def test_a_take_that_a_second_hit_ends_does_not_cut_the_others() -> None:
    rng = np.random.default_rng(5)
    whole = [take(PLATE, rng) for _ in range(4)]
    at = round(0.9 * 44100)
    whole[3][at:] += 1.5 * whole[2][round(0.05 * 44100) :][: len(whole[3]) - at]
    takes = tuple(take_of(x, 44100, str(k)) for k, x in enumerate(whole))
    assert takes[3].hit_again and len(takes[3].signal) < 0.9 * len(takes[0].signal)
    assert signals_of(takes, 44100).shape[0] == 3
    assert signals_of(takes, 44100).shape[1] == min(len(one.signal) for one in takes[:3])


def test_lines_that_move_together_keep_their_order() -> None:
    assert uncross_partners(np.array([211.9, 214.7]), np.array([205.6, 208.1]), np.array([1, 0])).tolist() == [0, 1]


@pytest.mark.slow
def test_a_series_has_a_law_that_tells_the_state_left_out() -> None:
    numbers = np.array([0.0, 0.01, 0.02, 0.03, 0.04, 0.06])
    states = [state(f"m{k}", PLATE, 1, 20 + k, mass=m) for k, m in enumerate(numbers)]
    values = tuple(
        values_of(RecordedState(s.name, s.takes, s.sr, float(m))) for s, m in zip(states, numbers, strict=True)
    )
    found = find_series(values)
    assert found is not None and found.verdict == "added-mass" and len(found.moving) >= 3
    assert np.median([law.error_share for law in found.moving]) < 0.1
    last = predict_by_law(values, found)["m5"]
    assert last.after_db < last.before_db and last.gap_closed > 0.6
