"""Non-modal part of recorded strikes, as a value; the package `residual` makes, transfers and plays it."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from sonic_bullet.records.arrays import Array, frozen_array, require, store


@dataclass(frozen=True, slots=True, eq=False)
class Residual:
    """Non-modal part of recorded strikes [Ren, Yeh, Lin 2013, sec. 6]; all levels are relative to its modes.

    No unit but Hz and s is left in it.

    Parameters
    ----------
    mode_freq_hz, mode_decay_per_s, mode_amplitude : Array, shape (m,)
        The source's modes, ascending; amplitudes at the onset, mean square over the strikes.
    line_freq_hz, line_decay_per_s, line_amplitude : Array, shape (l,)
        Lines of the recording that modes lack.
    freq_hz, time_s : Array, shapes (b,), (n,)
        Centres of the cells of power_per_hz, ascending, time from the onset.
    power_per_hz : Array, shape (b, n)
        Noise power per Hz (two-sided), bilinear between the centres.
    clip_energy
        Of the recordings, in amplitude² · s, which the residual does not exceed.
    source
        What it was taken from.

    Raises
    ------
    RecordError
        Arrays do not fit, hold NaN or no modes, modes are 60 dB below the recordings, or the residual exceeds them.
    """

    mode_freq_hz: Array
    mode_decay_per_s: Array
    mode_amplitude: Array
    line_freq_hz: Array
    line_decay_per_s: Array
    line_amplitude: Array
    freq_hz: Array
    time_s: Array
    power_per_hz: Array
    clip_energy: float
    source: str = ""

    def __post_init__(self) -> None:
        """Check the fields."""
        # largest numbers of a sound; products of larger ones overflow
        largest = {"freq_hz": 1e6, "decay_per_s": 1e6, "amplitude": 1e6, "time_s": 1e4, "power_per_hz": 1e9}
        faintest = 1e-6
        m, count = len(np.atleast_1d(self.mode_freq_hz)), len(np.atleast_1d(self.line_freq_hz))
        b, n = len(np.atleast_1d(self.freq_hz)), len(np.atleast_1d(self.time_s))
        shapes: dict[str, tuple[int, ...]] = {"freq_hz": (b,), "time_s": (n,), "power_per_hz": (b, n)}
        for part, size in (("mode", m), ("line", count)):
            shapes |= {f"{part}_{name}": (size,) for name in ("freq_hz", "decay_per_s", "amplitude")}
        store(
            self,
            **{
                name: frozen_array(getattr(self, name), float, shape, f"residual {name}")
                for name, shape in shapes.items()
            },
        )
        require(
            m > 0 and bool((self.mode_amplitude > 0).any()),
            "a residual without modes to follow",
            "take it from a recording that has some",
        )
        require(
            b > 1 and n > 1, "a residual whose spectrogram is empty", "take it from a recording that holds an impact"
        )
        for name in ("mode_freq_hz", "freq_hz", "time_s"):
            value = getattr(self, name)
            require(
                bool((value >= 0).all() and (np.diff(value) > 0).all() and value[-1] > 0),
                f"residual {name} does not ascend",
                "take the residual anew",
            )
        low = min(float(getattr(self, name).min(initial=0.0)) for name in shapes)
        slow = min(float(self.mode_freq_hz[0]), float(self.line_freq_hz.min(initial=1.0)))
        require(low >= 0 and slow > 0, "a residual with numbers below zero", "take it anew")
        slowest_line_hz = 0.01
        require(slow >= slowest_line_hz, f"a residual's line at {slow:.3g} Hz", "take it anew: nothing rings there")
        for name in shapes:
            value, most = (
                float(getattr(self, name).max(initial=0.0)),
                next(top for part, top in largest.items() if name.endswith(part)),
            )
            require(
                value <= most,
                f"residual {name} of {value:.3g}",
                f"take it anew: nothing of a sound is above {most:.0e}",
            )
        energy, modal = (
            self.energy,
            float((self.mode_amplitude**2 / (4 * np.maximum(self.mode_decay_per_s, 0.1))).sum()),
        )
        level_margin = 1.1  # a preset's levels are kept to a quarter of a decibel
        require(
            energy <= level_margin * self.clip_energy < np.inf,
            "a residual louder than the recordings it was taken from",
            "take it anew: what is left of a sound is less",
        )
        require(
            modal >= faintest * energy and modal > faintest**2,
            "a residual beside modes too faint to follow",
            "take it from a strike that excites them",
        )

    @property
    def share_of_clip(self) -> float:
        """Energy of the residual over that of the recordings."""
        return self.energy / self.clip_energy if self.clip_energy > 0 else 0.0

    @property
    def energy(self) -> float:
        """Energy ∫ p² dt of lines and noise of the source, in amplitude² · s: a²/4d a line, 2∬S df dt for the noise."""
        noise = np.trapezoid(np.trapezoid(self.power_per_hz, self.time_s, axis=1), self.freq_hz)
        return float(2 * noise + (self.line_amplitude**2 / (4 * np.maximum(self.line_decay_per_s, 0.1))).sum())
