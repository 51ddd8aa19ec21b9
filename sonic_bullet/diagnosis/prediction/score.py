"""How far what is played is from what was recorded, over the recording's noise: the distance that `fit` prints.

D(recorded, g·played + noise's power), D of a noisy take of what is played        (estimator.fit.takes.best_gain)
    g: 1 where the impulse is known, else the best

comparable(takes, made) is the one door: what has no distance stays outside, by name and with its reason, and what is
let in has one from what any hypothesis predicts, a plain float:

    neither stands above the noise   -> EDGE_DB, what noise makes of a sound that just stands above it
    what is played is not finite     -> ∞, farther than whatever can be played
"""

from __future__ import annotations

from collections.abc import Iterable, Sequence
from dataclasses import dataclass
from functools import lru_cache
from typing import NewType, Protocol

import numpy as np

from sonic_bullet.diagnosis.prediction.hypothesis import Hypothesis
from sonic_bullet.diagnosis.prediction.prediction import Prediction, Predictions, predict_each
from sonic_bullet.diagnosis.prediction.struck_bodies import Struck
from sonic_bullet.estimator.fit.recorded import RecordedObject as Recorded
from sonic_bullet.estimator.fit.takes.best_gain import BestGain, distance_at, find_best_gain
from sonic_bullet.estimator.lines.log_spectral import (
    ABOVE,
    WINDOWS,
    Floor,
    floor_between,
    power_spectra,
    white,
    with_noise,
)
from sonic_bullet.records import Array
from sonic_bullet.records.counts import format_count

# rms of a noisy take of a cell with power over noise ABOVE
EDGE_DB = float(20 / np.log(10) / np.sqrt(2 * ABOVE))
KEPT = 24  # takes whose spectra are kept


class Judged(Protocol):
    """Something measured that a hypothesis is held against, in dB."""

    @property
    def name(self) -> str:
        """What a person would call it."""
        ...

    @property
    def body(self) -> Struck:
        """What was struck."""
        ...

    def hindrance(self, p: Prediction) -> str:
        """Why it has no distance from what is predicted of its body; empty where it has one."""
        ...

    def distance(self, p: Prediction) -> float:
        """How far what is predicted is from it; ∞ where that plays nothing finite."""
        ...

    def least(self, p: Prediction) -> float:
        """How far it would be from itself, measured again."""
        ...


Comparable = NewType("Comparable", tuple[Judged, ...])  # one or more without a hindrance; `comparable` alone makes it


@dataclass(frozen=True, slots=True)
class LeftOut:
    """Something measured that could not be compared, and why."""

    name: str
    why: str

    def __str__(self) -> str:
        return f"{self.name} {self.why}"


@dataclass(frozen=True, slots=True, eq=False)
class Compared:
    """What a hypothesis can be held against, and what could not be compared."""

    takes: Comparable
    left_out: tuple[LeftOut, ...] = ()


@dataclass(frozen=True, slots=True)
class Incomparable:
    """Nothing can be compared, and why: empty where nothing was measured."""

    left_out: tuple[LeftOut, ...]


def predict_takes(h: Hypothesis, takes: Iterable[Judged]) -> Predictions:
    """What a hypothesis says of the bodies that the takes are of, once each."""
    return predict_each(h, (take.body for take in takes))


def comparable(takes: Sequence[Judged], made: Predictions) -> Compared | Incomparable:
    """Which of the takes have a distance from what is predicted of their bodies, and from whatever else is held against
    the same recordings.
    """
    why = [take.hindrance(made[take.body]) for take in takes]
    out = tuple(LeftOut(take.name, reason) for take, reason in zip(takes, why, strict=True) if reason)
    kept = tuple(take for take, reason in zip(takes, why, strict=True) if not reason)
    return Compared(Comparable(kept), out) if kept else Incomparable(out)


@dataclass(frozen=True, slots=True)
class Score:
    """How far a hypothesis is from what it was held against, and how far it would be from itself, measured again: both
    in dB, means over the strikes.

    There is one only where there is something comparable; else `comparable` says `Incomparable`.
    """

    distance_db: float
    floor_db: float

    @property
    def gap_db(self) -> float:
        """What is open: distance over noise alone."""
        return self.distance_db - self.floor_db


@dataclass(frozen=True, slots=True, eq=False)
class Take:
    """A recorded strike: which of which body, its samples (n,) from the onset on, and its noise."""

    body: Struck
    strike: int
    sample: Array
    sr: int
    floor: Floor

    @property
    def place(self) -> tuple[Recorded, int]:
        """Where it is in the evidence: among whose strikes, and which of those.

        Raises ValueError where it was not fitted.
        """
        if self.body.recorded is None:
            raise ValueError(f"{self.body.name} was not fitted")
        return self.body.recorded, self.body.fitted.index(self.strike)

    @property
    def name(self) -> str:
        """Its file's name, or its body's and its number."""
        file = self.body.recordings[self.strike].file
        return file.name if file is not None else f"{self.body.name}, strike {self.strike + 1}"

    def played(self, p: Prediction) -> Array:
        """What is predicted of it (n,), at the best gain where the impulse is not known."""
        made = self._made(p)
        return self._best(power_spectra(made)).gain * made if np.isfinite(made).all() else made

    def _made(self, p: Prediction) -> Array:
        return p.sound(self.strike, len(self.sample), self.sr)

    def hindrance(self, p: Prediction) -> str:
        """Why it has no distance from what is predicted; empty where it has one."""
        if wrong := int((~np.isfinite(self.sample)).sum()):
            return f"holds {wrong} samples that are no numbers"
        if len(self.sample) < min(WINDOWS):
            return f"holds {format_count(len(self.sample), 'sample')} after the onset, and {min(WINDOWS)} are needed"
        made = self._made(p)
        if not np.isfinite(made).all():
            return "is played by the model with samples that are no numbers"
        if not np.isfinite(self._apart(made)):
            return (
                f"does not stand {10 * np.log10(ABOVE):.0f} dB above the noise anywhere, nor does what the model "
                "plays of it"
            )
        return ""

    def distance(self, p: Prediction) -> float:
        """D in dB of the recording and what is predicted; see the module's head."""
        return self.apart_db(self._made(p))

    def apart_db(self, made: Array) -> float:
        """D in dB of the recording and whatever is played in its place (n,)."""
        return _stated(self._apart(made)) if np.isfinite(made).all() else np.inf

    def _apart(self, made: Array) -> float:
        return self._best(power_spectra(made)).distance_db

    def _best(self, power: tuple[Array, ...]) -> BestGain:
        """The gain of what is played, by its powers, and D there: 1 where the strike's impulse is known."""
        recorded, floor = _spectra(self)
        if np.isfinite(self.body.impulse_n_s[self.strike]):
            return BestGain(1.0, distance_at(recorded, power, floor, 1.0))
        return find_best_gain(recorded, power, floor)

    def least(self, p: Prediction) -> float:
        """D of a noisy take of what is predicted."""
        made = self._made(p)
        power = power_spectra(made)
        gain = self._best(power).gain
        again = power_spectra(with_noise(gain * made, self.floor, self.strike))
        return _stated(distance_at(again, power, _spectra(self)[1], gain))


@lru_cache(maxsize=KEPT)
def _spectra(take: Take) -> tuple[tuple[Array, ...], Floor]:
    """Powers of a take, and its noise in the band that is recorded."""
    return power_spectra(take.sample), take.floor.within(take.sr, take.body.band_hz)


def take_of(body: Struck, strike: int, sample: Array, sr: int) -> Take:
    """A recorded strike with the noise that its own end tells."""
    finite = bool(np.isfinite(sample).all()) and len(sample) >= min(WINDOWS)
    return Take(body, strike, sample, sr, floor_between([sample]) if finite else white(np.inf))


def _stated(db: float) -> float:
    """A distance of finite sounds; EDGE_DB where neither stands above the noise, and no cell tells."""
    return EDGE_DB if np.isnan(db) else db


def mean_db(takes: Comparable, made: Predictions) -> float:
    """Mean distance over takes."""
    return float(np.mean([take.distance(made[take.body]) for take in takes]))


def least_db(takes: Comparable, made: Predictions) -> float:
    """Mean noise floor of the distance over takes."""
    return float(np.mean([take.least(made[take.body]) for take in takes]))
