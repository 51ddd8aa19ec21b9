"""Frequency responses with known answers, written as an analyser would by pyuff."""

from __future__ import annotations

from pathlib import Path
from typing import Any

import numpy as np
import pyuff

from sonic_bullet.records import Array

QUANTITY = {"displacement": 8, "velocity": 11, "acceleration": 12, "pressure": 15}
LINES, STEP_HZ = 16_001, 0.5


def mobility(freq_hz: Array, decay_per_s: Array, weight: Array, at_hz: Array) -> Array:
    """Y(f) = ½ Σ ψ [s/(iω − p) + s*/(iω − p*)], s = 1 + i d/ω: of Σ ψ e^{−dt}(cos ωt − (d/ω) sin ωt), per N·s."""
    omega, made = 2j * np.pi * at_hz, np.zeros(len(at_hz), complex)
    for f, d, psi in zip(freq_hz, decay_per_s, weight, strict=True):
        pole, start = -d + 2j * np.pi * f, 1 + 1j * d / (2 * np.pi * f)
        made += 0.5 * psi * (start / (omega - pole) + np.conj(start) / (omega - np.conj(pole)))
    return made


def at_lines(lines: int = LINES, step_hz: float = STEP_HZ, first: int = 0) -> Array:
    return step_hz * (first + np.arange(lines))


def as_quantity(value: Array, at_hz: Array, quantity: str) -> Array:
    """A mobility as the response of another quantity."""
    power = {"displacement": -1, "velocity": 0, "acceleration": 1, "pressure": 0}[quantity]
    omega = np.where(at_hz > 0, 2j * np.pi * at_hz, 1.0)
    return np.where((at_hz > 0) | (power >= 0), value * omega**power, 0.0)


def response(
    value: Array, at_hz: Array, *, strike: tuple[int, int] = (1, -3), sensor: tuple[int, int] = (2, 3), **more: Any
) -> dict[str, Any]:
    """A dataset 58: a frequency response per N between degrees of freedom (node, axis)."""
    return {
        "type": 58,
        "func_type": 4,
        "rsp_node": sensor[0],
        "rsp_dir": sensor[1],
        "ref_node": strike[0],
        "ref_dir": strike[1],
        "data": value,
        "x": at_hz,
        "abscissa_spacing": 1,
        "abscissa_spec_data_type": 18,
        "ordinate_spec_data_type": QUANTITY["acceleration"],
        "orddenom_spec_data_type": 13,
    } | more


def nodes(places: dict[int, tuple[float, float, float]], kind: int = 15) -> dict[str, Any]:
    """A dataset 15 or 2411."""
    number = list(places)
    x, y, z = (list(column) for column in zip(*places.values(), strict=True))
    zero = [0] * len(number)
    return {
        "type": kind,
        "node_nums": number,
        "def_cs": zero,
        "disp_cs": zero,
        "color": zero,
        "x": x,
        "y": y,
        "z": z,
    }


def write_uff(path: Path, *sets: dict[str, Any]) -> Path:
    pyuff.UFF(str(path)).write_sets([dict(one) for one in sets], "overwrite")
    return path
