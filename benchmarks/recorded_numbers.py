"""Numbers of a body of known shape, as measured facts: E, ν and the loss of its modes, each as far as its spread goes.

lines that `fit --csv` wrote -> modes that ring -> a damping law, where one stands for all of them -> preset
"""

from __future__ import annotations

import math
from typing import Any

import msgspec
import numpy as np

from benchmarks.recorded_objects import Struck
from sonic_bullet.effects.damping_law import OMEGA_1, DampingLaw
from sonic_bullet.effects.damping_law.damping_form import Damping
from sonic_bullet.effects.presets_of_effects import to_preset
from sonic_bullet.files.presets import Elasticity, Preset, named_preset
from sonic_bullet.lab.effects.damping_law import FEWEST_LAW_LINES, LAW_GAIN_BIC

LOSS_SCATTER = math.log(2.0)
"""Of the logarithms of decays about a law, at most, for it to stand for them: tables of one material differ so."""
FALL_DB = 3.0
"""In the shortest take, of a mode whose decay is quoted: of less a drift of any kind is as much."""
NEAR = 0.003
"""Relative, of lines that are one mode's, or a pair's that a round body has in place of one."""
EQUAL_AT_HZ = (500.0, 8000.0)
"""Where Rayleigh's pair meets a loss factor, as in the presets of tables."""

Rows = list[dict[str, float]]


def rounded(value: float, spread: float = 0.0, digits: int = 3) -> float:
    """A number to ``digits``, or fewer where a quarter of its spread is no less than what is lost."""
    if 0 < spread < math.inf:
        value = round(value, -math.floor(math.log10(spread / 2)))
    return float(f"{value:.{digits}g}")


def ringing_modes(rows: Rows, seconds: float) -> Rows:
    """Of the lines at each mode that was paired, the one that rings longest, where it falls far enough in a take.

    What dies sooner at a mode's frequency is the attack, or a beat that was taken for a decay.
    """
    found: Rows = []
    for mode_hz in sorted({row["mode_hz"] for row in rows if "mode_hz" in row}):
        near = [row for row in rows if abs(row["freq_hz"] - mode_hz) < NEAR * mode_hz]
        row = min(near, key=lambda one: one["decay_per_s"])
        if row not in found and 20 * math.log10(math.e) * row["decay_per_s"] * seconds >= FALL_DB:
            found.append(row)
    return found


def law_of(modes: Rows) -> tuple[DampingLaw, float]:
    """The damping law of modes, a constant loss factor or a power of frequency, by the Bayes information criterion; and
    the scatter of the logarithms of decays about it.
    """
    omega = 2 * np.pi * np.array([row["freq_hz"] for row in modes])
    decay, count = np.log([row["decay_per_s"] for row in modes]), len(modes)
    ratio = np.log(omega / OMEGA_1)
    slope, level = np.polyfit(ratio, decay, 1)
    constant, power = decay - ratio - (decay - ratio).mean(), decay - slope * ratio - level
    score = [count * math.log(float((r**2).mean())) + k * math.log(count) for r, k in ((constant, 1), (power, 2))]
    if score[0] < score[1] + LAW_GAIN_BIC:
        eta = 2 * math.exp(float((decay - ratio).mean())) / OMEGA_1
        return DampingLaw("constant-loss", rounded(eta, digits=2)), float(constant.std(ddof=1))
    eta = 2 * math.exp(float(level)) / OMEGA_1
    return DampingLaw("power", rounded(eta, digits=2), exponent=rounded(float(slope))), float(power.std(ddof=2))


def damping_of(modes: Rows, guess: str) -> tuple[Damping, tuple[dict[str, Any], ...]]:
    """Damping and effects of a preset of numbers: the law of its modes where they have one, else the guess's."""
    rings = ", ".join(f"{row['freq_hz']:.0f} Hz {row['t60_s']:.2g} s" for row in modes)
    note, shown = f"T60 measured: {rings}", f"decays of {len(modes)} modes"
    law, scatter = law_of(modes) if len(modes) >= FEWEST_LAW_LINES else (None, math.inf)
    if law is None or scatter > LOSS_SCATTER:
        taken = f"taken from '{guess}': {shown} alone are known, or scatter by more than a factor of 2"
        return msgspec.structs.replace(
            named_preset(guess).damping, range={}, range_source="", spread={}, includes_radiation=False, source=taken,
            note=note,
        ), ()  # fmt: skip
    omega = 2 * np.pi * np.array(EQUAL_AT_HZ)
    low, high = law.decay_per_s(omega)
    beta = 2 * (high - low) / (omega[1] ** 2 - omega[0] ** 2)
    damping = Damping(
        alpha_per_s=rounded(2 * low - beta * omega[0] ** 2), beta_s=rounded(beta), includes_radiation=True, note=note,
        source=f"fitted to {shown}: they scatter by {scatter:.0%} about the law among the effects, which Rayleigh's "
        "pair meets at 500 Hz and 8 kHz",
    )  # fmt: skip
    return damping, (to_preset(law),)


def with_numbers(preset: Preset, modes: Rows, thing: Struck) -> Preset:
    """A preset of a mesh with E, ν and density, and what its modes say of its loss."""
    fitted = preset.provenance
    assert fitted is not None
    error = fitted.spreads["gamma_m2_s2"], fitted.spreads["poisson_ratio"]
    if None in error:
        raise SystemExit("E/ρ or ν is not identifiable")
    density = thing.density_kg_m3 or preset.density_kg_m3
    poisson = rounded(preset.elasticity.poisson or 0.0, error[1] or 0.0)
    gamma = rounded(fitted.parameters["gamma_m2_s2"], error[0] or 0.0, 4)
    weighed = "as weighed" if thing.density_kg_m3 else f"taken from '{thing.guess}'"
    elasticity = Elasticity(
        youngs_pa=rounded(gamma * density, (error[0] or 0.0) * density, 4), poisson=poisson, note=thing.shape_note,
        source=f"fitted; density {weighed}",
    )  # fmt: skip
    damping, effects = damping_of(modes, thing.guess)
    assumed = () if thing.density_kg_m3 else fitted.assumed[:1]
    return msgspec.structs.replace(
        preset, density_kg_m3=density, elasticity=elasticity, damping=damping, effects=effects, residual=None,
        note="numbers of one object, as measured facts; no recorded lines and no residual",
        provenance=msgspec.structs.replace(fitted, assumed=assumed),
    )  # fmt: skip
