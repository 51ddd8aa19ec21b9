"""Made takes of a plate whose modes are known in closed form, in states that differ by one change each.

A simply supported rectangle: f_mn = c ((m/a)² + (n/b)²), φ_mn = sin(mπx/a) sin(nπy/b); a mass or a dashpot at a point
by the rank-one problems that they are; a strike is half a sine of finite length, a microphone weighs modes by their
shape at a place, a room is a tail of noise. Noise is coloured, places and strengths scatter from take to take, onsets
are not declared.
"""

from __future__ import annotations

from dataclasses import dataclass, replace

import numpy as np

from sonic_bullet.lab.states.recorded_states import RecordedState, take_of
from sonic_bullet.records import Array


@dataclass(frozen=True)
class Plate:
    """A plate and how it is struck and recorded; lengths in m, times in s."""

    size: tuple[float, float] = (0.37, 0.29)
    lowest_hz: float = 310.0
    alpha_per_s: float = 3.0
    beta_s: float = 2.5e-7
    mass: float = 0.0  # at a point, over the plate's
    dashpot_per_s: float = 0.0  # at a point, c over the plate's mass
    place: tuple[float, float] = (0.12, 0.21)  # of either
    stretch: float = 1.0  # of all frequencies
    strike: tuple[float, float] = (0.31, 0.08)
    scatter_m: float = 0.004
    contact_s: float = 3e-4
    strength_db: float = 2.0
    microphone: tuple[float, float] = (0.07, 0.05)
    room: tuple[float, float] = (0.0, 0.0)  # level of the tail, its T60
    echoes: int = 7  # seed of the tail
    filter_db: tuple[float, float] = (0.0, 2000.0)  # a shelf above a corner
    rattle: float = 0.0  # noise that follows the plate's motion, over its rms
    noise_db: float = -55.0
    rings_along: tuple[float, float, float] = (0.0, 0.0, 0.0)  # another resonator: level, Hz, T60
    highest_hz: float = 9000.0


def modes_of(plate: Plate) -> tuple[Array, Array, Array]:
    """Frequencies (k,), decays (k,) and the modal shapes' numbers m, n (2, k)."""
    a, b = plate.size
    scale = plate.lowest_hz / (1 / a**2 + 1 / b**2)
    m, n = np.meshgrid(np.arange(1, 40), np.arange(1, 40), indexing="ij")
    freq = scale * ((m / a) ** 2 + (n / b) ** 2)
    keep = np.flatnonzero(freq.ravel() < plate.highest_hz)
    keep = keep[np.argsort(freq.ravel()[keep])]
    freq = freq.ravel()[keep]
    decay = 0.5 * (plate.alpha_per_s + plate.beta_s * (2 * np.pi * freq) ** 2)
    return freq, decay, np.array([m.ravel()[keep], n.ravel()[keep]])


def shape_at(plate: Plate, number: Array, place: tuple[float, float]) -> Array:
    """Values (k,) of the shapes at a place, of a mean square of 1 over the plate."""
    return (
        2 * np.sin(np.pi * number[0] * place[0] / plate.size[0]) * np.sin(np.pi * number[1] * place[1] / plate.size[1])
    )


def take(plate: Plate, rng: np.random.Generator, sr: int = 44100, seconds: float = 1.6) -> Array:  # noqa: PLR0915
    """One recording."""
    freq, decay, number = modes_of(plate)
    lam = (2 * np.pi * freq) ** 2
    at = shape_at(plate, number, plate.place)
    turn = np.eye(len(freq))
    if plate.mass:
        root = 1 / np.sqrt(lam)
        value, vector = np.linalg.eigh((np.eye(len(lam)) + plate.mass * np.outer(at, at)) * root[:, None] * root)
        value, vector = value[::-1], vector[:, ::-1]
        turn = root[:, None] * vector / np.sqrt(value)
        decay = (turn**2 * decay[:, None]).sum(axis=0)
        freq = 1 / np.sqrt(value) / (2 * np.pi)
    decay = decay + 0.5 * plate.dashpot_per_s * (turn.T @ at) ** 2
    freq = freq * plate.stretch
    place = tuple(np.array(plate.strike) + plate.scatter_m * rng.standard_normal(2))
    strength = 10 ** (plate.strength_db * rng.standard_normal() / 20)
    u = freq * plate.contact_s * strength**-0.2
    with np.errstate(divide="ignore", invalid="ignore"):
        pulse = np.where(np.abs(u - 0.5) < 1e-6, np.pi / 4, np.cos(np.pi * u) / (1 - 4 * u**2))
    gain = turn.T @ shape_at(plate, number, place) * (turn.T @ shape_at(plate, number, plate.microphone))
    gain = strength * gain * pulse
    t = np.arange(round(seconds * sr)) / sr
    clean = np.zeros(len(t))
    for f, d, g in zip(freq, decay, gain, strict=True):
        clean += g * np.exp(-d * t) * np.sin(2 * np.pi * f * t)
    if plate.rings_along[0]:
        level, hz, t60 = plate.rings_along
        clean += strength * level * np.exp(-6.91 / t60 * t) * np.sin(2 * np.pi * hz * t)
    if plate.rattle:
        envelope = np.sqrt(np.convolve(clean**2, np.ones(sr // 100) / (sr // 100))[: len(t)])
        hiss = rng.standard_normal(len(t))
        hiss = np.diff(hiss, prepend=0.0)
        clean += plate.rattle * envelope * hiss / 2**0.5
    if plate.room[0]:
        level, t60 = plate.room
        tail = np.random.default_rng(plate.echoes).standard_normal(len(t)) * np.exp(-6.91 / t60 * t)
        tail *= level / np.sqrt((tail**2).sum())
        tail[: sr // 300] = 0
        size = 2 * len(t)
        clean = clean + np.fft.irfft(np.fft.rfft(clean, size) * np.fft.rfft(tail, size), size)[: len(t)]
    if plate.filter_db[0]:
        size = 2 * len(t)
        at_hz = np.fft.rfftfreq(size, 1 / sr)
        shelf = 10 ** (plate.filter_db[0] / 20 * at_hz**2 / (at_hz**2 + plate.filter_db[1] ** 2))
        clean = np.fft.irfft(np.fft.rfft(clean, size) * shelf, size)[: len(t)]
    lead = round((0.05 + 0.03 * rng.random()) * sr)
    whole = np.concatenate([np.zeros(lead), clean])
    noise = rng.standard_normal(len(whole))
    spectrum = np.fft.rfft(noise)
    colour = 1 / np.sqrt(1 + (np.fft.rfftfreq(len(whole), 1 / sr) / 200))
    noise = np.fft.irfft(spectrum * colour, len(whole))
    peak = 2.0 * float(np.sqrt((gain**2).sum())) / strength
    noise *= 10 ** (plate.noise_db / 20) * peak / np.sqrt((noise**2).mean())
    return 0.3 / peak * (whole + noise)


def state(name: str, plate: Plate, count: int, seed: int, **change: object) -> RecordedState:
    """A state of some takes."""
    rng = np.random.default_rng(seed)
    changed = replace(plate, **change)  # type: ignore[arg-type]
    sr = 44100
    return RecordedState(name, tuple(take_of(take(changed, rng, sr), sr, f"{name}{k}") for k in range(count)), sr)
