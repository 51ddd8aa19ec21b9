"""Recordings of one thing in two or more states -> what changed, which physics, how well, and the law of a number.

read_states -> values_of (each state) -> compare_states -> find_causes -> predict -> StateComparison
states with numbers -> series.py -> StateSeries
"""

from __future__ import annotations

from dataclasses import asdict, dataclass, replace
from typing import Any

from sonic_bullet.effects.added_mass import AddedMass
from sonic_bullet.lab.states.changes import Changes, StateValues, compare_states, values_of
from sonic_bullet.lab.states.recorded_states import RecordedState
from sonic_bullet.lab.states.state_causes import Cause, find_causes
from sonic_bullet.lab.states.state_noise import noise_to_json, state_noise
from sonic_bullet.lab.states.state_series import StateSeries, find_series, predict_by_law
from sonic_bullet.lab.states.take_prediction import TakePrediction, predict
from sonic_bullet.machine.progress import report_progress


@dataclass(frozen=True, slots=True, eq=False)
class StateComparison:
    """Two states: what changed, what makes it, how well that predicts.

    by_series: its takes are too few by themselves, and the law of the series' number names and predicts it.
    """

    changes: Changes
    causes: tuple[Cause, ...]
    prediction: TakePrediction | None
    same_strikes: bool = False
    by_series: bool = False

    @property
    def verdict(self) -> str:
        """Return "none", "too few takes", "unexplained", or the effects' names."""
        if self.changes.method == "too few takes" and not self.causes:
            return "too few takes"
        if self.by_series:
            return ", ".join(one.name for one in self.causes)
        if not self.changes.anything:
            return "none"
        return ", ".join(one.name for one in self.causes) or "unexplained"

    def to_json(self) -> dict[str, Any]:
        """Return every number."""
        before, after = self.changes.before.state, self.changes.after.state
        return {
            "before": before.name,
            "after": after.name,
            "verdict": self.verdict,
            "method": self.changes.method,
            "same_strikes": self.same_strikes,
            "by_series": self.by_series,
            "changed": [asdict(row) for row in self.changes.rows if row.certain],
            "causes": [asdict(one) for one in self.causes],
            "prediction": None if self.prediction is None else asdict(self.prediction),
            "compared": [asdict(row) for row in self.changes.rows],
            "spectrum": None if self.changes.shift is None else asdict(self.changes.shift),
            "common_stretch_percent": 100 * self.changes.pairs.stretch,
            "pairs_beyond_chance": self.changes.pairs.beyond_chance,
        }


@dataclass(frozen=True, slots=True, eq=False)
class ComparedStates:
    """All states, the comparisons of the first with each other one, and the series where states have numbers."""

    states: tuple[RecordedState, ...]
    comparisons: tuple[StateComparison, ...]
    series: StateSeries | None

    def to_json(self) -> dict[str, Any]:
        """Return every number."""
        values = [self.comparisons[0].changes.before, *(one.changes.after for one in self.comparisons)]
        return {
            "states": [
                {
                    "name": one.name,
                    "number": one.number,
                    "takes": [
                        {"name": take.name, "peak_dbfs": take.strength_db, "note": take.note} for take in one.takes
                    ],
                    "sr": one.sr,
                    "noise_beside_lines": noise_to_json(state_noise(measured)),
                }
                for one, measured in zip(self.states, values, strict=True)
            ],
            "comparisons": [one.to_json() for one in self.comparisons],
            "series": None if self.series is None else asdict(self.series),
        }


def compare(states: tuple[RecordedState, ...], *, same_strikes: bool = False) -> ComparedStates:
    """Compare the first state with each other one, and find the law of their numbers.

    same_strikes: take by take the states are recordings of the same strikes, as by two microphones.
    """
    values = []
    for state in states:
        report_progress(f"listening to {state.name}")
        values.append(values_of(state))
    made = []
    for k, after in enumerate(values[1:], 1):
        report_progress(f"holding {states[k].name} against {states[0].name}")
        others = tuple(one for j, one in enumerate(values) if j not in (0, k))
        found = compare_states(values[0], after, others, same_strikes=same_strikes)
        causes = find_causes(found, same_strikes=same_strikes)
        report_progress(f"predicting {states[k].name}")
        made.append(StateComparison(found, causes, predict(found, causes), same_strikes))
    series = None
    if len(states) >= 3 and all(one.number is not None for one in states):
        report_progress("looking for the law of the number")
        series = find_series(tuple(values))
        if series is not None:
            made = _named_by_series(made, tuple(values), series)
    return ComparedStates(states, tuple(made), series)


def _named_by_series(
    comparisons: list[StateComparison], values: tuple[StateValues, ...], series: StateSeries
) -> list[StateComparison]:
    """Name what too few takes alone cannot say by the law of the number, where it moves a line there."""
    least_percent = 0.3  # of a line's frequency: less is what neighbours and temperature move lines by
    predicted = predict_by_law(values, series)
    named = []
    for one in comparisons:
        after = one.changes.after.state
        k = series.states.index(after.name)
        moved = [law for law in series.moving if abs(law.shift_percent[k]) > least_percent]
        if one.changes.method != "too few takes" or not moved or after.name not in predicted:
            named.append(one)
            continue
        most = max(moved, key=lambda law: abs(law.shift_percent[k]))
        cause = Cause(
            most.effect,
            ("lost-stiffness",) if most.effect == AddedMass.id else ("removed-mass",),
            True,
            f"{most.freq_hz:.1f} Hz goes {most.shift_percent[k]:+.3g} % by the law of the series' number "
            f"({most.predicted_percent[k]:+.3g} % by the other states)",
            "more takes of each state",
            {"largest_shift_percent": most.shift_percent[k], "predicted_percent": most.predicted_percent[k]},
            len(moved),
        )
        named.append(replace(one, causes=(cause,), prediction=predicted[after.name], by_series=True))
    return named
