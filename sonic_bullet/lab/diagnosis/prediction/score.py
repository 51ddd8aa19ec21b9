"""Distance of a synthesis from the recording, over the recording's noise, the same as `fit` prints.

D(recorded, g·played + noise's power), D of a noisy take of what is played        (estimator.fit.takes.best_gain)
    g: 1 where the impulse is known, else the best

comparable(takes, made) is the only way to a comparison: what has no distance is excluded, by name and with its reason,
and what is included has one from what any hypothesis predicts, a plain float:

    neither is above the noise       -> EDGE_DB, the effect of noise on a sound just above it
    what is played is not finite     -> ∞, farther than whatever can be played
"""

from __future__ import annotations

from collections.abc import Iterable, Sequence
from dataclasses import dataclass
from functools import lru_cache
from typing import NewType, Protocol

import numpy as np

from sonic_bullet.lab.diagnosis.prediction.hypothesis import Hypothesis
from sonic_bullet.lab.diagnosis.prediction.prediction import Prediction, Predictions, predict_each
from sonic_bullet.lab.diagnosis.prediction.struck_bodies import StruckBody
from sonic_bullet.lab.diagnosis.thresholds import RULES
from sonic_bullet.lab.fit.recorded import RecordedObject as Recorded
from sonic_bullet.lab.fit.takes.best_gain import BestGain, distance_at, find_best_gain
from sonic_bullet.records import Array
from sonic_bullet.records.counts import format_count
from sonic_bullet.signal.log_spectral import (
    ABOVE_NOISE,
    SPECTRAL_WINDOWS,
    Floor,
    floor_between,
    noise_spectra,
    power_spectra,
    white,
    with_noise,
)

# rms of a noisy take of a cell with power over noise ABOVE
EDGE_DB = float(20 / np.log(10) / np.sqrt(2 * ABOVE_NOISE))
FEW_CELLS = (EDGE_DB / 0.2) ** 2
"""Cells of which a mean is known to 0.2 dB, the least that an effect must gain: a take that has fewer says little."""


class ScoredObservation(Protocol):
    """Something measured with which a hypothesis is compared, in dB."""

    @property
    def name(self) -> str:
        """Name it for people."""
        ...

    @property
    def body(self) -> StruckBody:
        """Return the body that was struck."""
        ...

    @property
    def weight(self) -> float:
        """Return how much it can say, 0 to 1."""
        ...

    def hindrance(self, p: Prediction) -> str:
        """Return the reason why it has no distance from a prediction of its body; empty where it has one."""
        ...

    def distance(self, p: Prediction) -> float:
        """Compute its distance from a prediction; ∞ where that is not finite."""
        ...

    def least(self, p: Prediction) -> float:
        """Compute its distance from itself, measured again."""
        ...


Comparable = NewType(
    "Comparable", tuple[ScoredObservation, ...]
)  # one or more without a hindrance; `comparable` alone makes it


@dataclass(frozen=True, slots=True)
class LeftOut:
    """Something measured that could not be compared, and why."""

    name: str
    why: str

    def __str__(self) -> str:
        """Format it as a line."""
        return f"{self.name} {self.why}"


@dataclass(frozen=True, slots=True, eq=False)
class ComparableTakes:
    """What a hypothesis can be compared with, and what could not be compared."""

    takes: Comparable
    left_out: tuple[LeftOut, ...] = ()


@dataclass(frozen=True, slots=True)
class Incomparable:
    """Nothing can be compared, and why: empty where nothing was measured."""

    left_out: tuple[LeftOut, ...]


def predict_takes(h: Hypothesis, takes: Iterable[ScoredObservation]) -> Predictions:
    """Predict the bodies that the takes are of, once each."""
    return predict_each(h, (take.body for take in takes))


def comparable(takes: Sequence[ScoredObservation], made: Predictions) -> ComparableTakes | Incomparable:
    """Divide takes into those with a distance from a prediction of their bodies, and those without.

    Those with one have a distance from any other prediction, too.
    """
    why = [take.hindrance(made[take.body]) for take in takes]
    out = tuple(LeftOut(take.name, reason) for take, reason in zip(takes, why, strict=True) if reason)
    kept = tuple(take for take, reason in zip(takes, why, strict=True) if not reason)
    return ComparableTakes(Comparable(kept), out) if kept else Incomparable(out)


@dataclass(frozen=True, slots=True)
class Score:
    """Distance of a hypothesis from what it was compared with.

    It exists only where something is comparable; else `comparable` returns `Incomparable`.

    Attributes
    ----------
    distance_db : float
        Mean over the strikes.
    floor_db : float
        Distance from itself, measured again, likewise.
    """

    distance_db: float
    floor_db: float

    @property
    def gap_db(self) -> float:
        """Return distance over noise alone."""
        return self.distance_db - self.floor_db


@dataclass(frozen=True, slots=True, eq=False)
class AudioObservation:
    """A recorded strike.

    Attributes
    ----------
    body : StruckBody
        The body that was struck.
    strike : int
        Index among its strikes.
    sample : (n,)
        From the onset on.
    sr : int
        Sampling rate in Hz.
    floor : Floor
        The recording's noise.
    """

    body: StruckBody
    strike: int
    sample: Array
    sr: int
    floor: Floor

    @property
    def place(self) -> tuple[Recorded, int]:
        """Return its place in the evidence: the fitted object, and the index among its strikes.

        Raises
        ------
        ValueError
            It was not fitted.
        """
        if self.body.recorded is None:
            raise ValueError(f"{self.body.name} was not fitted")
        return self.body.recorded, self.body.fitted.index(self.strike)

    @property
    def name(self) -> str:
        """Return its file's name, or its body's and its number."""
        file = self.body.recordings[self.strike].file
        return file.name if file is not None else f"{self.body.name}, strike {self.strike + 1}"

    @property
    def weight(self) -> float:
        """Return how much it can say: n/(n + FEW_CELLS) of n cells above the noise; nearly nothing of no impact."""
        cells, recorded = max(_cells(self), 1), self.body.recorded
        doubtful = recorded is not None and any(
            self.body.recordings[self.strike] == recorded.recordings[i] for i in recorded.doubtful
        )
        return cells / (cells + FEW_CELLS) * (RULES.little_share if doubtful else 1.0)

    def synthesize(self, p: Prediction) -> Array:
        """Synthesize it (n,) by a prediction, at the best gain where the impulse is not known."""
        made = self._synthesize(p)
        return self._best(power_spectra(made)).gain * made if np.isfinite(made).all() else made

    def _synthesize(self, p: Prediction) -> Array:
        """Synthesize it by a prediction."""
        return p.sound(self.strike, len(self.sample), self.sr)

    def hindrance(self, p: Prediction) -> str:
        """Return the reason why it has no distance from a prediction; empty where it has one."""
        if wrong := int((~np.isfinite(self.sample)).sum()):
            return f"holds {wrong} samples that are no numbers"
        if len(self.sample) < min(SPECTRAL_WINDOWS):
            held = format_count(len(self.sample), "sample")
            return f"holds {held} after the onset, and {min(SPECTRAL_WINDOWS)} are needed"
        made = self._synthesize(p)
        if not np.isfinite(made).all():
            return "is played by the model with samples that are no numbers"
        if not np.isfinite(self._distance(made)):
            return (
                f"does not stand {10 * np.log10(ABOVE_NOISE):.0f} dB above the noise anywhere, nor does what "
                "the model plays of it"
            )
        return ""

    def distance(self, p: Prediction) -> float:
        """Compute D in dB of the recording and a prediction; see the module's head."""
        return self.apart_db(self._synthesize(p))

    def apart_db(self, made: Array) -> float:
        """Compute D in dB of the recording and any synthesis (n,)."""
        return _finite_distance_db(self._distance(made)) if np.isfinite(made).all() else np.inf

    def _distance(self, made: Array) -> float:
        """Compute D of a finite synthesis, NaN where neither is above the noise."""
        return self._best(power_spectra(made)).distance_db

    def _best(self, power: tuple[Array, ...]) -> BestGain:
        """Find the gain of a synthesis, by its powers, and D there: 1 where the strike's impulse is known."""
        recorded, floor = _spectra(self)
        if np.isfinite(self.body.impulse_n_s[self.strike]):
            return BestGain(1.0, distance_at(recorded, power, floor, 1.0))
        return find_best_gain(recorded, power, floor)

    def least(self, p: Prediction) -> float:
        """Compute D of a noisy take of a prediction."""
        made = self._synthesize(p)
        power = power_spectra(made)
        gain = self._best(power).gain
        again = power_spectra(with_noise(gain * made, self.floor, self.strike))
        return _finite_distance_db(distance_at(again, power, _spectra(self)[1], gain))


@lru_cache(maxsize=24)  # takes whose spectra are kept
def _spectra(take: AudioObservation) -> tuple[tuple[Array, ...], Floor]:
    """Compute the powers of a take, and its noise in the band that is recorded."""
    return power_spectra(take.sample), take.floor.within(take.sr, take.body.band_hz)


@lru_cache(maxsize=64)
def _cells(take: AudioObservation) -> int:
    """Count the cells of a take that stand above its noise."""
    power, floor = _spectra(take)
    return sum(int((p > ABOVE_NOISE * cell).sum()) for p, cell in zip(power, noise_spectra(floor, power), strict=False))


def take_of(body: StruckBody, strike: int, sample: Array, sr: int, session: Floor | None = None) -> AudioObservation:
    """Build a recorded strike, with the noise of its own end and the session's, which may be narrow."""
    finite = bool(np.isfinite(sample).all()) and len(sample) >= min(SPECTRAL_WINDOWS)
    floor = floor_between([sample]) if finite else white(np.inf)
    return AudioObservation(body, strike, sample, sr, floor if session is None else floor.over(session))


def _finite_distance_db(db: float) -> float:
    """Return a distance of finite sounds; EDGE_DB where neither is above the noise."""
    return EDGE_DB if np.isnan(db) else db


def mean_db(takes: Comparable, made: Predictions) -> float:
    """Compute the mean distance over takes, each by what it can say."""
    return _mean(takes, [take.distance(made[take.body]) for take in takes])


def least_db(takes: Comparable, made: Predictions) -> float:
    """Compute the mean noise floor of the distance over takes, likewise."""
    return _mean(takes, [take.least(made[take.body]) for take in takes])


def _mean(takes: Comparable, db: list[float]) -> float:
    weight = np.array([take.weight for take in takes])
    return float(np.average(db, weights=weight if weight.any() else None))
