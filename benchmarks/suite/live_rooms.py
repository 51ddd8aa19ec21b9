"""A session in a room as it is: a floor that is not white, hum that goes on through it, onsets that nobody declared.

    x_i(t) = strike(t − lead_i) + floor(t) + Σ_k a_k cos(2πk f₀ (T_i + t) + φ_k)

T_i is when take i begins in the session: hum has one f₀, one level and one phase a multiple for all takes. The floor is
recorded (the quiet stretches of a folder's recordings, in grains that overlap with powers that add up to one) or
drawn, its density |H|² = (1 + (f₁/f)^a) / (1 + (f/f₂)^b). Quiet stretches of five measured sets rise by 13 to 26 dB
from 1 kHz down to 31 Hz, and fall by 0 to 17 dB from 1 to 16 kHz: a is 1 to 2 there, b 0 to 2.
"""

from __future__ import annotations

from dataclasses import dataclass
from functools import lru_cache
from pathlib import Path
from typing import Any

import numpy as np

from sonic_bullet.records import Array

BELOW_PEAK_DB = (45.0, 60.0)
"""Rms of the floor and of the hum below the loudest peak, each drawn."""
LEAD_S = (0.15, 0.5)
MOST_MULTIPLES = 12
GRAIN_S = 0.3


@dataclass(frozen=True, slots=True, eq=False)
class LiveRoom:
    """Noise of a session in units of the file, and how late its takes begin to sound.

    recorded: quiet stretches at ``rate``, empty where the floor is drawn by ``slopes`` (a, b) about f₁, f₂. hum:
    amplitude and phase of its multiples; begin_s: when a take begins in the session; lead_s: its onset.
    """

    rate: int
    floor_rms: float
    recorded: tuple[Array, ...]
    slopes: tuple[float, float]
    hum_hz: float
    hum_amplitude: Array
    hum_phase: Array
    begin_s: Array
    lead_s: Array

    def lead(self, which: int) -> int:
        """Samples of a take before its onset."""
        return round(float(self.lead_s[which]) * self.rate)

    def hum(self, n: int, which: int) -> Array:
        """What hums in a take."""
        t = self.begin_s[which] + np.arange(n) / self.rate
        k = np.arange(1, len(self.hum_amplitude) + 1)
        turn = 2 * np.pi * self.hum_hz * np.outer(k, t) + self.hum_phase[:, None]
        return np.asarray(self.hum_amplitude @ np.cos(turn))

    def floor(self, rng: np.random.Generator, n: int) -> Array:
        """Some of its floor."""
        x = _grains(rng, self.recorded, n, self.rate) if self.recorded else _coloured(rng, n, self.rate, self.slopes)
        return np.asarray(self.floor_rms * x)

    def noise(self, rng: np.random.Generator, n: int, which: int) -> Array:
        """Floor and hum of a take."""
        return self.floor(rng, n) + self.hum(n, which)

    def truth(self) -> dict[str, Any]:
        """What it is, for the truth of a case."""
        return {
            "floor_rms": self.floor_rms,
            "recorded": bool(self.recorded),
            "slopes": list(self.slopes),
            "hum_hz": self.hum_hz,
            "hum_amplitude": self.hum_amplitude.tolist(),
            "lead_s": self.lead_s.tolist(),
        }


def drawn(rng: np.random.Generator, rate: int, takes: int, peak: float, folder: Path | None = None) -> LiveRoom:
    """A session by chance: takes of a loudest ``peak``; folder: of recordings whose quiet stretches are its floor."""
    floor_db, hum_db = rng.uniform(*BELOW_PEAK_DB, 2)
    mains = float(rng.choice([50.0, 60.0]))
    many = int(rng.integers(4, MOST_MULTIPLES + 1))
    k = np.arange(1, many + 1)
    # a transformer's odd multiples or a rectifier's even ones are louder
    level = np.exp(0.7 * rng.standard_normal(many)) / k * np.where(k % 2 == int(rng.integers(2)), 1.0, 0.4)
    level *= peak * 10 ** (-hum_db / 20) / np.sqrt((level**2).sum() / 2)
    stretches = quiet_stretches(folder, rate) if folder is not None else ()
    chosen = (stretches[int(rng.integers(len(stretches)))],) if stretches else ()
    return LiveRoom(
        rate,
        float(peak * 10 ** (-floor_db / 20)),
        chosen,
        (float(rng.uniform(1, 2)), float(rng.uniform(0, 2))),
        float(mains * (1 + rng.uniform(-1e-3, 1e-3))),  # as far as the mains go from their number
        level,
        rng.uniform(0, 2 * np.pi, many),
        np.cumsum(rng.uniform(3, 10, takes)),
        rng.uniform(*LEAD_S, takes),
    )


def _coloured(rng: np.random.Generator, n: int, rate: int, slopes: tuple[float, float]) -> Array:
    """Gaussian noise (n,) of rms 1 of the density at the module's head."""
    low_hz, high_hz, rumble_hz = 1000.0, 4000.0, 20.0
    freq = np.maximum(np.fft.rfftfreq(n, 1 / rate), rumble_hz)
    density = (1 + (low_hz / freq) ** slopes[0]) / (1 + (freq / high_hz) ** slopes[1])
    x = np.fft.irfft(np.fft.rfft(rng.standard_normal(n)) * np.sqrt(density), n)
    return np.asarray(x / np.sqrt(np.mean(density)))


def _grains(rng: np.random.Generator, recorded: tuple[Array, ...], n: int, rate: int) -> Array:
    """Noise (n,) of rms 1 of recorded grains, overlapping by half, powers adding up to one."""
    size = 2 * (round(GRAIN_S * rate) // 2)
    shape = np.sin(np.pi * (np.arange(size) + 0.5) / size)
    out = np.zeros(n + 2 * size)
    for at in range(0, n + size, size // 2):
        sound = recorded[int(rng.integers(len(recorded)))]
        first = int(rng.integers(len(sound) - size + 1))
        out[at : at + size] += rng.choice([-1.0, 1.0]) * shape * sound[first : first + size]
    return out[size : size + n]


@lru_cache(maxsize=2)
def quiet_stretches(folder: Path, rate: int) -> tuple[Array, ...]:
    """Stretches of rms 1 in which a folder's recordings of this rate are at their quietest for three grains or more."""
    import soundfile

    block_s, near_db = 0.05, 3.0
    found = []
    for path in sorted(p for p in folder.rglob("*") if p.suffix in (".wav", ".flac")):
        sound, sr = soundfile.read(path, always_2d=True)
        block = round(block_s * sr)
        power = (sound[: len(sound) // block * block, 0].reshape(-1, block) ** 2).mean(axis=1)
        if sr != rate or len(power) < 3 or not power.all():
            continue
        quiet = power < 10 ** (near_db / 10) * np.quantile(power, 0.1)
        edge = np.flatnonzero(np.diff(np.concatenate([[0], quiet, [0]])))
        first, last = max(zip(edge[::2], edge[1::2], strict=True), key=lambda run: run[1] - run[0])
        if (last - first) * block_s < 3 * GRAIN_S:
            continue
        part = sound[first * block : last * block, 0]
        part = part - part.mean()
        found.append(part / part.std())
    return tuple(found)
