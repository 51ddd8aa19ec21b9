"""Twelve changes of a recording, and the kind of effect that must be said of each."""

from __future__ import annotations

from collections.abc import Callable
from pathlib import Path
from typing import Any

import numpy as np

from sonic_bullet.apps.compare import compare
from sonic_bullet.apps.compare.sides import Side
from sonic_bullet.files import write_audio


def lowpassed(x: Any, sr: int) -> Any:
    pole = np.exp(-2 * np.pi * 4000 / sr)
    y = np.zeros_like(x)
    last = np.zeros(len(x))
    for i in range(x.shape[1]):
        last = pole * last + (1 - pole) * x[:, i]
        y[:, i] = last
    return y


def changes(x: Any, sr: int) -> dict[str, tuple[str, Any, int]]:
    """kind of effect, samples and rate of each."""
    rng, n = np.random.default_rng(35), x.shape[1]
    rms, t = float(np.sqrt(np.square(x).mean())), np.arange(x.shape[1]) / sr
    late = np.concatenate([np.zeros((len(x), sr // 1000)), x], axis=1)[:, :n]
    gap = x.copy()
    loud = int(np.argmax(np.abs(x[0])))
    gap[:, loud + 500 : loud + 1500] = 0
    limit = 0.3 * float(np.abs(x).max())
    from scipy.signal import resample_poly

    return {
        "gain 0.5 dB": ("gain", x * 10 ** (0.5 / 20), sr),
        "1 ms later": ("delay", late, sr),
        "channels swapped": ("channels", x[::-1], sr),
        "a low-pass at 4 kHz": ("filter", lowpassed(x, sr), sr),
        "clipped at 0.3": ("clipping", np.clip(x, -limit, limit), sr),
        "polarity": ("polarity", -x, sr),
        "rate": ("rate", resample_poly(x, 147, 160, axis=1), 44_100),
        "noise at -40 dB": ("noise", x + rng.normal(0, 0.01 * rms, x.shape), sr),
        "hum of 50 Hz": ("tone", x + 0.02 * rms * np.sin(2 * np.pi * 50 * t), sr),
        "a constant": ("offset", x + 0.05 * rms, sr),
        "a gap of 20 ms": ("gap", gap, sr),
        "cut short": ("length", x[:, : n - sr // 10], sr),
    }


def recordings(side: Side, folder: Path, line: Callable[..., None]) -> None:
    """A table of what is said."""
    mono = side.sound.samples()[0]
    x = np.stack([mono, np.roll(mono, 40) * 0.8 + 0.1 * np.roll(mono, 777)])
    write_audio(str(folder / "a.wav"), x, side.sr)
    right = 0
    listed = changes(x, side.sr)
    for name, (kind, samples, sr) in listed.items():
        write_audio(str(folder / "b.wav"), samples, sr)
        found = compare(folder / "a.wav", folder / "b.wav")
        kinds = [one.kind for one in found.effects]
        good = not found.same and kinds[:1] == [kind] and not found.differences
        right += good
        line(name, found.effects[0].words if found.effects else "nothing", "" if good else f"WRONG {kinds}")
    line("recordings", f"{right} of {len(listed)} described", "no cause named")
