"""Presets of materials as things are made of them: the loss of measured bodies, and nothing else of a recording.

    python -m benchmarks.made_presets [--table TABLE.csv] [--out FOLDER]

docs/measured/decays.csv -> median T60 of a material's bodies by octave -> law -> FOLDER/made-NAME.json

The law is fitted to ln T60 of the medians of ENOUGH bodies, each octave by its number of bodies; of all octaves where
none has so many. Of constant loss, power, and power with
a floor of T60 it is the first that keeps within FACTOR of each median of ENOUGH bodies. Its spread is that of the
bodies about it. All else is the preset's of the material alone.
"""

from __future__ import annotations

import argparse
from collections.abc import Sequence
from pathlib import Path

import msgspec
import numpy as np

from benchmarks.measured_decays import TABLE, MeasuredDecay, read_table
from benchmarks.preset_decays import ENOUGH, FACTOR, medians, rows_of
from benchmarks.recorded_presets import write_compactly
from sonic_bullet.effects.damping_law import DampingLaw
from sonic_bullet.effects.damping_law.damping_form import Damping
from sonic_bullet.files.presets import MADE_FOLDER, Preset, named_preset
from sonic_bullet.records import Array

MEASURED = {
    "aluminium": "metal", "brass": "metal", "copper": "metal", "glass": "glass", "metal": "metal",
    "plastic": "plastic", "porcelain": "porcelain", "spruce": "spruce", "steel": "steel", "wood": "wood",
}  # fmt: skip
"""Materials, and the measured one whose bodies say their loss: of three metals none was measured, and all stand in."""
NUMBERS = ("loss_factor", "exponent", "floor_s")


def law_of_numbers(number: Array) -> DampingLaw:
    """Make a law of (ln η), (ln η, p) or (ln η, p, ln T₀)."""
    power = float(number[1]) if len(number) > 1 else 1.0
    floor_s = float(np.exp(number[2])) if len(number) > 2 else 0.0
    return DampingLaw("power" if len(number) > 1 else "constant-loss", float(np.exp(number[0])), power, floor_s=floor_s)


def ln_t60(number: Array, octave_hz: Array) -> Array:
    """Compute ln T60 (k,) of a law at octaves (k,)."""
    return np.log(np.log(1000) / law_of_numbers(number).decay_per_s(2 * np.pi * octave_hz))


def fitted(rows: Sequence[MeasuredDecay], count: int) -> Array:
    """Fit a law of ``count`` numbers to the medians of bodies."""
    from scipy.optimize import least_squares

    found = medians(rows)
    judged = {octave: one for octave, one in found.items() if one[1] >= ENOUGH}
    found = judged or found
    octave, bodies = np.array(list(found), float), np.array([n for _, n in found.values()])
    wanted = np.log([t60 for t60, _ in found.values()])
    start = np.array([-6.0, 1.3, -2.5])[:count]
    bounds = ([-12.0, 0.0, -5.0][:count], [0.0, 3.0, 0.0][:count])
    return np.asarray(least_squares(lambda p: np.sqrt(bodies) * (ln_t60(p, octave) - wanted), start, bounds=bounds).x)


def chosen(rows: Sequence[MeasuredDecay]) -> Array:
    """Choose the first law that keeps within FACTOR of the medians of ENOUGH bodies."""
    judged = {octave: t60 for octave, (t60, n) in medians(rows).items() if n >= ENOUGH}
    for count in (1, 2, 3):
        number = fitted(rows, count)
        off = ln_t60(number, np.array(list(judged), float)) - np.log(list(judged.values()))
        if not len(off) or np.abs(off).max() <= np.log(FACTOR):
            return number
    raise SystemExit(
        f"no law of three numbers keeps within a factor of {FACTOR:g} of the medians of {rows[0].material}"
    )


def digits(value: float) -> float:
    return float(f"{value:.2g}")


def made_preset(name: str, rows: Sequence[MeasuredDecay]) -> Preset:
    """Make the preset of a material as things are made of it. rows: of the whole table."""
    mine = rows_of(MEASURED[name], rows)
    number = chosen(mine)
    law = law_of_numbers(number)
    value = {"loss_factor": digits(law.eta)}
    if len(number) > 1:
        value["exponent"] = digits(law.exponent)
    if len(number) > 2:
        value["floor_s"] = digits(law.floor_s)
    bodies = list(dict.fromkeys(r.body for r in mine))
    apart = []
    for body in bodies:
        own = [r for r in mine if r.body == body]
        apart.append(
            np.mean([ln_t60(number, np.array([float(r.octave_hz)]))[0] - np.log(r.t60_s) for r in own])
        )  # of ln η: a body that rings shorter than the law loses more
    spread = float(np.std(apart, ddof=1)) if len(bodies) > 1 else 0.0
    note = "" if len(bodies) > 1 else "one body: the spread is a factor of two"
    spread = spread or float(np.log(FACTOR))
    low, high = np.exp(min([*apart, -spread])), np.exp(max([*apart, spread]))
    ranges = {"loss_factor": (digits(value["loss_factor"] * low), digits(value["loss_factor"] * high))}
    spreads = {"loss_factor": digits(spread)}
    for key, k in (("exponent", 1), ("floor_s", 2)):
        if key not in value:
            continue
        left_out = [fitted([r for r in mine if r.body != body], len(number))[k] for body in bodies]
        others = np.exp(left_out) if k == 2 else np.array(left_out)  # the floor's logarithm was fitted
        n = len(bodies)
        error = float(np.sqrt((n - 1) / n * ((np.log(others) - np.log(others).mean()) ** 2).sum()))
        spreads[key] = digits(min(max(error, 0.01), 1.0))
        factor = np.exp(spreads[key])
        ranges[key] = (digits(value[key] / factor), digits(value[key] * factor))
    stand_in = (
        ""
        if MEASURED[name] in (name, "metal") and name in ("metal", MEASURED[name])
        else (f"; no body of {name} was measured: metals stand in")
    )
    sets = ", ".join(dict.fromkeys(r.set for r in mine))
    damping = Damping(
        loss_factor=value["loss_factor"], exponent=value.get("exponent"), floor_s=value.get("floor_s"),
        includes_radiation=True,
        source=f"docs/measured/decays.csv (2026), median T60 by octave of {len(bodies)} bodies{stand_in}: "
        f"{', '.join(bodies)} (sets {sets}); python -m benchmarks.made_presets",
        note=note, range=ranges, spread=spreads,
        range_source="the bodies about the law; of exponent and floor the standard error when each body is left out",
    )  # fmt: skip
    alone = named_preset(name)
    return msgspec.structs.replace(
        alone, name=f"made-{name}", damping=damping, thermal=None,
        note=f"{name} as things are made of it: total damping of measured bodies; '{name}' is the material alone",
    )  # fmt: skip


def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0] if __doc__ else "")
    parser.add_argument("--table", type=Path, default=TABLE)
    parser.add_argument("--out", type=Path, default=MADE_FOLDER)
    asked = parser.parse_args()
    rows = read_table(asked.table)
    asked.out.mkdir(parents=True, exist_ok=True)
    for name in MEASURED:
        preset = made_preset(name, rows)
        write_compactly(asked.out / f"{preset.name}.json", preset)
        said = {key: msgspec.structs.asdict(preset.damping)[key] for key in NUMBERS}
        print(f"{preset.name}: {said}, spread {preset.damping.spread}")


if __name__ == "__main__":
    main()
