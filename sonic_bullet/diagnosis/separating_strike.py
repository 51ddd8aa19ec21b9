"""The strike that would separate two models most, of those at the places struck so far, from soft to hard.

    two models A, B -> a take of A with the recordings' noise -> D(take, B) − D(take, A) -> max over places and impulses

D: prediction/score.py. A and B are the two best of the table: what is named, or the baseline, and the best of the rest.
What separates them is what they predict of a take that nobody has made, so it is a test of both [Box & Hill 1967].
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, replace

import numpy as np

from sonic_bullet.diagnosis.prediction.hypothesis import Hypothesis
from sonic_bullet.diagnosis.prediction.prediction import Prediction, predict
from sonic_bullet.diagnosis.prediction.score import AudioObservation, ScoredObservation
from sonic_bullet.diagnosis.selection.stepwise import Closed, NothingCompared
from sonic_bullet.signal.log_spectral import with_noise

TIMES = (0.125, 0.25, 0.5, 1.0, 2.0, 4.0)
"""Impulses over the middle one so far: as far as a hand goes with one hammer."""


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
        where = "" if self.position_m is None else f" at ({', '.join(f'{x:g}' for x in self.position_m)}) m"
        hard = f" with {self.impulse_n_s:.2g} N·s," if np.isfinite(self.impulse_n_s) else ""
        spread = f" ± {self.apart_sd_db:.1f}" if np.isfinite(self.apart_sd_db) else ""
        return (
            f"{self.body}{where}{hard} {self.times:g} times the middle strike: {self.models[0]} and "
            f"{self.models[1]} lie {self.apart_db:.1f}{spread} dB apart there, {self.apart_so_far_db:.1f} dB so far"
        )


def two_best(end: Closed | NothingCompared) -> tuple[tuple[str, Hypothesis], tuple[str, Hypothesis]] | None:
    """Return the two best models, by name; None where no effect was tried."""
    named = {c.id for c in end.added}
    first = (_name(end.after), end.after)
    rest = sorted((c for c in end.tried if c.id not in named), key=lambda c: -c.mean_db)
    if rest and (rest[0].mean_db > 0 or not named):
        return first, (_name(rest[0].hypothesis), rest[0].hypothesis)
    return (first, (_name(end.before), end.before)) if named else None


def separating_strike(end: Closed | NothingCompared) -> SeparatingStrike | None:
    """Find the strike that would separate the two best models most; None without two, or without recordings."""
    models, takes = two_best(end), _one_a_place(end.judged if isinstance(end, Closed) else ())
    if models is None or not takes:
        return None
    found: list[SeparatingStrike] = []
    for body in dict.fromkeys(take.body for take in takes):
        one, other = (predict(h, body) for _, h in models)
        mine = [take for take in takes if take.body is body]
        middle = float(np.median(body.level_n_s[body.fitted]))
        so_far = float(np.mean([_apart_db(t, one, other, float(body.level_n_s[t.strike])) for t in mine]))
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
    return max(found, key=lambda one: one.apart_db)


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
