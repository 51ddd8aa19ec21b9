"""The values that travel inside the estimator: what was observed, and what it says of the material.

    x(t) = Σ a e^{−d(t−t₀)} sin(2πf(t−t₀) + φ)   for t ≥ t₀                            [Ren, Yeh, Lin 2013, eq. 4, 8]
    d = ½(α + βλ),  λ = γ λ̂(ν),  a = σ â                                               [eq. 6-8, section 5]

f here is the damped frequency a recording shows, d the decay rate of the amplitude in 1/s, k features.
"""

from __future__ import annotations

from dataclasses import dataclass, field, replace

import numpy as np

from sonic_bullet.lab.lines.shared_poles import FASTEST_PER_S
from sonic_bullet.records import Array, frozen_array
from sonic_bullet.records.errors import RecordError

PINNED = 0.98  # of the fastest decay there is


@dataclass(frozen=True, slots=True, eq=False)
class Features:
    """Damped sinusoids of one recording, strongest first.

    amplitude: in units of the recording (full scale 1) at the onset. Spreads are standard errors; a feature without one
    has NaN there. noise_dbfs: level of what is no feature, rms, per sample.
    """

    freq_hz: Array  # (k,) > 0
    decay_per_s: Array  # (k,) >= 0
    amplitude: Array  # (k,) > 0
    phase_rad: Array  # (k,)
    freq_sd_hz: Array  # (k,)
    decay_sd_per_s: Array  # (k,)
    amplitude_sd: Array  # (k,)
    onset_s: float
    noise_dbfs: float
    sr: int
    note: str = ""

    def __post_init__(self) -> None:
        """Refuse columns of other lengths, and values that no feature has."""
        count = len(np.atleast_1d(self.freq_hz))
        values = (
            ("freq_hz", self.freq_hz),
            ("decay_per_s", self.decay_per_s),
            ("amplitude", self.amplitude),
            ("phase_rad", self.phase_rad),
        )
        for name, value in values:
            object.__setattr__(self, name, frozen_array(value, np.float64, (count,), name))
        for name, value in (
            ("freq_sd_hz", self.freq_sd_hz),
            ("decay_sd_per_s", self.decay_sd_per_s),
            ("amplitude_sd", self.amplitude_sd),
        ):
            object.__setattr__(self, name, frozen_array(value, np.float64, (count,), name, finite=False))
        if (self.freq_hz <= 0).any() or (self.decay_per_s < 0).any() or (self.amplitude <= 0).any():
            raise RecordError(
                "features hold a frequency or amplitude of zero, or a negative decay", "keep only what was observed"
            )


def energy(decay_per_s: Array, amplitude: Array) -> Array:
    """Return ∫ (a e^{−dt} sin ωt)² dt (m,) for d ≪ ω of damped sinusoids (m,)."""
    return np.asarray(amplitude**2 / (4 * np.maximum(decay_per_s, 1e-3)))


@dataclass(frozen=True, slots=True, eq=False)
class MaterialFit:
    """What recordings say of a material: α 1/s, β s, γ = E/ρ m²/s², σ, ν.

    covariance (5, 5): of ln α, ln β, ln γ, ln σ, ν. A row and column of NaN: that parameter is not identifiable, and
    the verdict says so. verdict: "fitted", or why not, one line. modes: per mode freq_hz, decay_per_s, amplitude (m,)
    of the fitted model at the first strike.
    """

    alpha_per_s: float
    beta_s: float
    gamma_m2_s2: float
    sigma: float
    poisson_ratio: float
    covariance: Array  # (5, 5)
    verdict: str
    freq_hz: Array  # (m,)
    decay_per_s: Array  # (m,)
    amplitude: Array  # (m,)

    def __post_init__(self) -> None:
        """Refuse columns of other lengths."""
        count = len(np.atleast_1d(self.freq_hz))
        for name, value in (
            ("freq_hz", self.freq_hz),
            ("decay_per_s", self.decay_per_s),
            ("amplitude", self.amplitude),
        ):
            object.__setattr__(self, name, frozen_array(value, np.float64, (count,), name))
        object.__setattr__(
            self, "covariance", frozen_array(self.covariance, np.float64, (5, 5), "covariance", finite=False)
        )


@dataclass(frozen=True, slots=True, eq=False, weakref_slot=True)
class Lines:
    """k lines of s recordings of one object, by frequency. amplitude (s, k) complex at the onset.

    noise (s,): rms of what is no line. energy (k,): of a line over the noise's density. signed: phases are true, the
    onset being known. rise_s (s,): from the onset to the first peak, where the contact still drives them: amplitudes
    are taken back over it as if it did not, and what is played or judged of a line is `at_peak`.
    """

    freq_hz: Array
    decay_per_s: Array
    amplitude: Array
    freq_sd_hz: Array
    decay_sd_per_s: Array
    amplitude_sd: Array
    noise: Array
    energy: Array
    signed: bool
    rise_s: Array = field(default_factory=lambda: np.zeros(0))

    def __post_init__(self) -> None:
        """Let recordings of which nothing else is known begin with their peaks."""
        if not len(self.rise_s):
            object.__setattr__(self, "rise_s", np.zeros(len(self.amplitude)))

    @property
    def at_peak(self) -> Array:
        """Amplitudes (s, k) at the first peaks, of the phases at the onsets."""
        return np.asarray(self.amplitude * np.exp(-np.outer(self.rise_s, np.nan_to_num(self.decay_per_s))))

    @property
    def pole(self) -> Array:
        """−d + iω (k,) in 1/s."""
        return np.asarray(-self.decay_per_s + 2j * np.pi * self.freq_hz)

    @property
    def identified_sd_per_s(self) -> Array:
        """Spreads of the decays (k,), infinite at the fastest there is: a bound, no value."""
        return np.asarray(
            np.where(np.nan_to_num(self.decay_per_s) > PINNED * FASTEST_PER_S, np.inf, self.decay_sd_per_s)
        )


def struck_lines(lines: Lines, signals: Array, times: float) -> Lines:
    """Drop lines louder than so many times a recording's peak (s, n), in one of them, at its first.

    Of echoes that arrive late some are over so soon that a hit at the onset would have left them far above the rest.
    """
    return lines_at(lines, np.flatnonzero(~too_loud(lines, signals, times)))


def too_loud(lines: Lines, signals: Array, times: float) -> Array:
    """Which lines (k,) are, at the first peak: before it the contact drives them, and what they are is not known."""
    peak = np.abs(signals).max(axis=1, keepdims=True)
    return np.asarray((np.abs(lines.at_peak) > times * peak).any(axis=0))


def lines_at(lines: Lines, keep: Array) -> Lines:
    """Return some of the lines (k,), by index."""
    return replace(
        lines,
        freq_hz=lines.freq_hz[keep],
        decay_per_s=lines.decay_per_s[keep],
        amplitude=lines.amplitude[:, keep],
        freq_sd_hz=lines.freq_sd_hz[keep],
        decay_sd_per_s=lines.decay_sd_per_s[keep],
        amplitude_sd=lines.amplitude_sd[:, keep],
        energy=lines.energy[keep],
    )
