"""The strike that would separate two models most, of those at the places struck so far, from soft to hard.

    two models A, B -> a take of A with the recordings' noise -> D(take, B) − D(take, A) -> max over places and impulses

D: prediction/score.py. A is what is named, or the baseline; B the best of the rest that the evidence leaves open:
strikes left out say less than strong_evidence between them, and those made lie no farther apart than A from them.
What separates them is what they predict of a take that nobody has made, so it is a test of both [Box & Hill 1967].
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, replace

import numpy as np

from sonic_bullet.lab.diagnosis.prediction.hypothesis import Hypothesis
from sonic_bullet.lab.diagnosis.prediction.prediction import Prediction, predict
from sonic_bullet.lab.diagnosis.prediction.score import AudioObservation, ScoredObservation
from sonic_bullet.lab.diagnosis.selection.acceptance import Candidate, evidence
from sonic_bullet.lab.diagnosis.selection.stepwise import NothingCompared, SelectionEnd
from sonic_bullet.lab.diagnosis.thresholds import RULES
from sonic_bullet.signal.log_spectral import with_noise

TIMES = {
    0.125: "an eighth as hard",
    0.25: "a quarter as hard",
    0.5: "half as hard",
    1.0: "as hard",
    2.0: "twice as hard",
    4.0: "four times as hard",
}
"""Impulses over the middle one so far: as far as a hand goes with one hammer; in words."""


@dataclass(frozen=True, slots=True)
class SeparatingStrike:
    """A strike that nobody has made, and what two models say of it.

    Attributes
    ----------
    models : (2,) str
        Ids of the two models' effects, joined by +; "no effect" for the baseline.
    body : str
        What is struck.
    position_m : (3,)
        Where; None where no place is known.
    impulse_n_s : float
        How hard; NaN where impulses are not known.
    times : float
        The same over the middle strike so far.
    apart_db : float
        How much farther a take of the first model lies from the second one.
    apart_sd_db : float
        Standard deviation of that over the places struck so far, at this impulse; NaN of one place.
    apart_so_far_db : float
        Mean of the same over the strikes that were made.
    """

    models: tuple[str, str]
    body: str
    position_m: tuple[float, ...] | None
    impulse_n_s: float
    times: float
    apart_db: float
    apart_sd_db: float
    apart_so_far_db: float

    def __str__(self) -> str:
        """Format it as a sentence."""
        where = "the same place" if self.position_m is None else f"({', '.join(f'{x:g}' for x in self.position_m)}) m"
        hard = f" ({self.impulse_n_s:.2g} N·s)" if np.isfinite(self.impulse_n_s) else ""
        spread = f" ± {self.apart_sd_db:.1f}" if np.isfinite(self.apart_sd_db) else ""
        return (
            f"strike `{self.body}` at {where}, {TIMES[self.times]} as the middle strike{hard}: {self.models[0]} and "
            f"{self.models[1]} lie {self.apart_db:.1f}{spread} dB apart there, {self.apart_so_far_db:.1f} dB so far"
        )


def two_best(end: SelectionEnd | NothingCompared) -> tuple[tuple[str, Hypothesis], tuple[str, Hypothesis]] | None:
    """Return what is named, or the baseline, and the best that strikes left out do not separate from it, if any."""
    rest = sorted((c for c in end.tried if _is_open(c, end.added)), key=lambda c: -c.mean_db)
    return ((_name(end.after), end.after), (_name(rest[0].hypothesis), rest[0].hypothesis)) if rest else None


def _is_open(c: Candidate, named: Sequence[Candidate]) -> bool:
    """Decide whether strikes left out say less than strong_evidence for or against a candidate beside what is named."""
    if c.id in {one.id for one in named}:
        return False
    has = {effect.id for effect in c.hypothesis.effects}
    own = next((one for one in named if one.id not in has), None)  # that was taken in its place
    if own is not None and len(own.drop_db) != len(c.drop_db):
        return False  # it gained nothing on the loudest strikes
    gain = c.drop_db if own is None else c.drop_db - own.drop_db
    return abs(evidence(gain, c.gap_db)) <= RULES.strong_evidence


def separating_strike(end: SelectionEnd | NothingCompared) -> SeparatingStrike | None:
    """Find the strike that would separate the two best open models most; None without two, or without recordings."""
    models = two_best(end)
    if models is None or not isinstance(end, SelectionEnd):
        return None
    takes = _one_a_place(end.judged)
    left_db = max(RULES.suffices_db, end.after_db - end.floor_db)  # what a model leaves open by itself
    found: list[SeparatingStrike] = []
    for body in dict.fromkeys(take.body for take in takes):
        one, other = (predict(h, body) for _, h in models)
        mine = [take for take in takes if take.body is body]
        middle = float(np.median(body.level_n_s[body.fitted]))
        there = np.array([_apart_db(t, one, other, float(body.level_n_s[t.strike])) for t in mine])
        so_far = float(there.mean())
        if so_far > left_db:
            continue  # the strikes that were made separate them
        for times in TIMES:
            apart = np.array([_apart_db(take, one, other, times * middle) for take in mine])
            best = int(apart.argmax())
            recording = body.recordings[mine[best].strike]
            impulse = times * middle if np.isfinite(body.impulse_n_s).any() else float("nan")
            spread = float(apart.std(ddof=1)) if len(apart) > 1 else float("nan")
            found.append(
                SeparatingStrike(
                    (models[0][0], models[1][0]),
                    body.name,
                    recording.position_m,
                    impulse,
                    times,
                    float(apart[best]),
                    spread,
                    so_far,
                )
            )
    return max(found, key=lambda one: one.apart_db, default=None)


def _name(h: Hypothesis) -> str:
    """Name a model by its effects."""
    return " + ".join(effect.id for effect in h.effects) or "no effect"


def _one_a_place(judged: Sequence[ScoredObservation]) -> list[AudioObservation]:
    """Return one recorded strike of each place."""
    found: dict[tuple[str, object], AudioObservation] = {}
    for take in (t for t in judged if isinstance(t, AudioObservation)):
        found.setdefault((take.body.name, take.body.recordings[take.strike].position_m), take)
    return list(found.values())


def _apart_db(take: AudioObservation, one: Prediction, other: Prediction, impulse_n_s: float) -> float:
    """Compute by how much a take of one model at an impulse is farther from the other than from itself."""
    level = take.body.level_n_s.copy()
    level[take.strike] = impulse_n_s
    body = replace(take.body, impulse_n_s=level)
    a, b = replace(one, body=body), replace(other, body=body)
    sample = with_noise(a.sound(take.strike, len(take.sample), take.sr), take.floor, take.strike)
    made = replace(take, body=body, sample=sample)
    return made.distance(b) - made.distance(a)
