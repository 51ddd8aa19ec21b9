"""Twelve steel bars by this project's own modal solver, ± 1 % in each size and in mass: one notched, one damped more.

    python -m tests.lab.states.made_pieces        writes tests/data/twelve_bars.json: modes of each, and their gains

The takes are damped sinusoids of those modes in coloured noise, whose onset nobody declares.
"""

from __future__ import annotations

import json
from pathlib import Path

import numpy as np

from sonic_bullet.lab.states.recorded_states import RecordedState, take_of
from sonic_bullet.records import Array

SIZE_M = (0.20, 0.025, 0.008)
NOTCH = (0.37, 0.004, 0.35)
"""Place over the length, length in m, depth over the thickness."""
NOTCHED, DAMPED = 4, 9
HIGHEST_HZ = 14_000.0
DATA = Path(__file__).parents[2] / "data" / "twelve_bars.json"


def write_bars(seed: int = 67) -> None:
    """Solve the bars, and write their modes."""
    rng = np.random.default_rng(seed)
    bars = []
    for k in range(12):
        size = np.array(SIZE_M) * (1 + 0.01 * rng.standard_normal(3))
        density = 7850 * (1 + 0.01 * rng.standard_normal())
        bars.append(_modes(size, density, NOTCH[2] if k == NOTCHED else 0.0))
        print(k, np.round(bars[-1]["freq_hz"]), flush=True)
    DATA.write_text(json.dumps({"made by": "python -m tests.lab.states.made_pieces", "bars": bars}) + "\n")


def _modes(size_m: Array, density: float, depth: float) -> dict[str, list[float] | list[list[float]]]:
    """Frequencies, and the gain of each mode from a strike near one end to a microphone over the other, twice."""
    from tempfile import TemporaryDirectory

    from sonic_bullet.modal import analyse, read_mesh
    from sonic_bullet.records import Material

    steel = Material.isotropic(
        "steel", youngs_pa=2e11, poisson=0.29, density_kg_m3=density, alpha_per_s=3.0, beta_s=0.0
    )
    with TemporaryDirectory() as folder:
        path = Path(folder) / "bar.obj"
        path.write_text(_bar_obj(size_m, depth))
        model = analyse((read_mesh(path),), steel, to_hz=HIGHEST_HZ, accuracy=0.004, cache=None)
    length, width, height = size_m

    def normal_at(x: float, y: float) -> Array:
        place = np.array([x * length, y * width, height])
        return np.asarray(model.shape[np.abs(model.vertex_m - place).sum(axis=1).argmin(), 2])

    heard = normal_at(1.0, 0.3)
    gains = [normal_at(*place) * heard for place in ((0.06, 0.2), (0.09, 0.25))]
    return {"freq_hz": model.freq_hz.tolist(), "gain": [gain.tolist() for gain in gains]}


def _bar_obj(size_m: Array, depth: float) -> str:
    """Return a bar with a slot across its upper side as a closed surface, for all of them the same triangles."""
    length, width, height = size_m
    a, b = (NOTCH[0] * length + side * NOTCH[1] / 2 for side in (-1, 1))
    low = height * (1 - depth) if depth else height / 2
    # corners along the profile: below, above, and the slot's bottom; without a slot its corners lie on its sides
    profile = [(0, 0), (a, 0), (b, 0), (length, 0), (length, height), (b, height), (b, low), (a, low), (a, height)]
    profile.append((0, height))
    point = [(x, y, z) for y in (0.0, width) for x, z in profile]
    front = [(0, 1, 7), (0, 7, 8), (0, 8, 9), (1, 2, 6), (1, 6, 7), (3, 4, 5), (3, 5, 6), (3, 6, 2)]
    around = [(k, (k + 1) % 10) for k in range(10)]
    if not depth:  # the slot is filled: its three sides go, its mouth closes
        front += [(7, 6, 5), (7, 5, 8)]
        around = [(i, j) for i, j in around if (i, j) not in ((5, 6), (6, 7), (7, 8))] + [(5, 8)]
    face = [*front, *((10 + i, 10 + k, 10 + j) for i, j, k in front)]
    for i, j in around:
        face += [(j, i, 10 + i), (j, 10 + i, 10 + j)]
    lines = [f"v {x:.9g} {y:.9g} {z:.9g}" for x, y, z in point]
    return "\n".join([*lines, *(f"f {i + 1} {j + 1} {k + 1}" for i, j, k in face)]) + "\n"


def pieces(seed: int, *, notched: bool = True, damped: bool = True) -> tuple[RecordedState, ...]:
    """Two takes of each bar; without its odd ones, other bars stand for them."""
    rng = np.random.default_rng(seed)
    sr = 44100
    bars = json.loads(DATA.read_text())["bars"]
    made = []
    for k, bar in enumerate(bars):
        if k == NOTCHED and not notched:
            continue
        freq = np.array(bar["freq_hz"])
        decay = (3.0 + 1.5e-3 * freq * (1 + 0.05 * rng.standard_normal(len(freq)))) * (
            1.6 if k == DAMPED and damped else 1.0
        )
        takes = tuple(
            take_of(_sound(freq, decay, np.array(gain), rng, sr), sr, f"take{i}") for i, gain in enumerate(bar["gain"])
        )
        made.append(RecordedState(f"bar{k + 1:02d}", takes, sr))
    return tuple(made)


def _sound(freq: Array, decay: Array, gain: Array, rng: np.random.Generator, sr: int) -> Array:
    seconds, lead_s, noise_db = 1.2, 0.06, -70.0
    t = np.arange(round(seconds * sr)) / sr
    gain = gain / np.abs(gain).max() / (1 + (freq / 6000) ** 2)
    sound = (gain * np.exp(-decay * t[:, None]) * np.sin(2 * np.pi * freq * t[:, None])).sum(axis=1)
    whole = np.concatenate([np.zeros(round(lead_s * sr)), sound / np.abs(sound).max()])
    white = np.fft.rfft(rng.standard_normal(len(whole)))
    noise = np.fft.irfft(white / np.sqrt(1 + np.fft.rfftfreq(len(whole), 1 / sr) / 200), len(whole))
    noise *= 10 ** (noise_db / 20) / np.sqrt((noise**2).mean())
    return np.asarray(0.3 * 10 ** (rng.normal(0, 2) / 20) * (whole + noise))


if __name__ == "__main__":
    write_bars()
