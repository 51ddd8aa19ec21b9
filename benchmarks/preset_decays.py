"""Do presets ring as long as real things? T60 of every preset beside the measured bodies of its material, by octave.

    python -m benchmarks.preset_decays [--table TABLE.csv] [--out PAGE]

docs/measured/decays.csv (`benchmarks.measured_decays`) + the package's presets -> docs/measured/damping.md

Each body counts once; classes are shown, not counted. An octave is judged where ENOUGH bodies have lines in it: the
preset within FACTOR of their median.
"""

from __future__ import annotations

import argparse
import textwrap
from collections.abc import Iterator, Sequence
from pathlib import Path

import numpy as np

from benchmarks.decay_objects import STANDS_FOR
from benchmarks.measured_decays import OCTAVES_HZ, TABLE, MeasuredDecay, by_octave, read_table
from sonic_bullet.effects.damping_law import DampingLaw
from sonic_bullet.effects.recorded_lines import RecordedLines
from sonic_bullet.files.presets import load_material, made_names, recorded_names, table_names
from sonic_bullet.records import Array, Material

PAGE = Path("docs/measured/damping.md")
MADE = "made-"
ENOUGH, FACTOR = 3, 2.0
HEAD = """# How long things ring

Written by `python -m benchmarks.preset_decays` from [decays.csv](decays.csv), which `python -m
benchmarks.measured_decays --data ../shared/measured` measured. T60 in s, by octave.

- **Measured**: of each body the median over its lines in the octave: what rings after the attack, in at most four takes
  together. Lines count that decay by three of their spreads, by the energy that is left of them 20 ms after the onset:
  before lie the striker and the room. The koi bowl, the skillet, the stand, the scoop and the spruce plates are numbers
  of others' recordings (`tables-derived`). Decays are total, as recorded.
- **Median**: over the bodies; each counts once. Iron and bronze count as `metal`, steel as `steel` and as `metal`.
- **Presets**: the law of each at the octave's centre. `NAME` is the material alone: to its own loss the run time adds
  what a body radiates, and metals lose by heat, so such a body rings no longer than this. `made-NAME` is the material
  as things are made of it: a law of few numbers through the medians, total (`python -m benchmarks.made_presets`).
- **Judged** are octaves with three bodies or more: *ratio* is the preset over the median. More than a factor of two is
  bold.
- **Classes** are TDW's, of material and size. Nobody says which body stands behind one, so they are not counted.
"""


def decay_per_s(material: Material, freq_hz: Array) -> Array:
    """Compute a material's decays (k,) at frequencies (k,), without what a body radiates: its law, or Rayleigh's."""
    omega = 2 * np.pi * freq_hz
    found = 0.5 * ((material.alpha_per_s or 0.0) + (material.beta_s or 0.0) * omega**2)
    for law in (effect for effect in material.effects if isinstance(effect, DampingLaw)):
        found = law.decay_per_s(omega)
    return np.asarray(found)


def t60_s(material: Material) -> dict[int, float]:
    """Compute T60 by octave; of a preset that holds recorded lines theirs, where there are any."""
    lines = [effect for effect in material.effects if isinstance(effect, RecordedLines)]
    if lines:
        columns = (lines[0].freq_hz, np.log(1000) / np.array(lines[0].decay_per_s), lines[0].amplitude)
        return {octave: t60 for octave, (t60, _) in by_octave(zip(*columns, strict=True)).items()}
    decay = decay_per_s(material, np.array(OCTAVES_HZ, float))
    return {octave: float(t) for octave, t in zip(OCTAVES_HZ, np.log(1000) / decay, strict=True)}


def rows_of(material: str, rows: Sequence[MeasuredDecay], kind: str = "body") -> list[MeasuredDecay]:
    """Select what is measured of a material, of a kind."""
    return [r for r in rows if r.kind == kind and material in STANDS_FOR.get(r.material, (r.material,))]


def medians(rows: Sequence[MeasuredDecay]) -> dict[int, tuple[float, int]]:
    """Compute the median T60 over bodies by octave, and how many they are."""
    found = {octave: [r.t60_s for r in rows if r.octave_hz == octave] for octave in OCTAVES_HZ}
    return {octave: (float(np.median(t60)), len(t60)) for octave, t60 in found.items() if t60}


def ratios(material: Material, rows: Sequence[MeasuredDecay]) -> dict[int, float]:
    """Compute T60 of a preset over the median of measured bodies, in octaves with ENOUGH of them."""
    own = t60_s(material)
    return {octave: own[octave] / m for octave, (m, n) in medians(rows).items() if n >= ENOUGH and octave in own}


def _cells(name: str, by: dict[int, str]) -> list[str]:
    return [name, *(by.get(octave, "") for octave in OCTAVES_HZ)]


def _values(rows: Sequence[MeasuredDecay], name: str) -> dict[int, str]:
    return {r.octave_hz: f"{r.t60_s:.2g}" for r in rows if r.body == name}


def _preset_rows(name: str, rows: Sequence[MeasuredDecay]) -> Iterator[list[str]]:
    material = load_material(name)
    yield _cells(f"`{name}`", {octave: f"{t:.2g}" for octave, t in t60_s(material).items()})
    found = ratios(material, rows)
    if found:
        bad = {octave: not 1 / FACTOR <= r <= FACTOR for octave, r in found.items()}
        shown = {octave: f"**{r:.2g}**" if bad[octave] else f"{r:.2g}" for octave, r in found.items()}
        yield _cells("… ratio", shown)


def presets_of(name: str) -> tuple[str, ...]:
    """List a material's presets: as things are made of it, if there is one, and alone."""
    return (*({MADE + name} & set(made_names())), name)


def section(name: str, presets: Sequence[str], rows: Sequence[MeasuredDecay]) -> str:
    """Write the table of a material: its presets, the median, each body, and the classes."""
    mine = rows_of(name, rows)
    cells: list[list[str]] = []
    middle = medians(mine)
    if middle:
        cells.append(_cells("**median** (bodies)", {o: f"{m:.2g} ({n})" for o, (m, n) in middle.items()}))
    for one in presets:
        cells += _preset_rows(one, mine)
    cells += [_cells(body, _values(mine, body)) for body in dict.fromkeys(r.body for r in mine)]
    classes = rows_of(name, rows, "class")
    cells += [_cells(f"*class {body}*", _values(classes, body)) for body in dict.fromkeys(r.body for r in classes)]
    return f"## {name.capitalize()}\n\n{_table(cells)}"


def _table(cells: Sequence[Sequence[str]]) -> str:
    head = ["T60 in s", *(f"{octave} Hz" for octave in OCTAVES_HZ)]
    return "\n".join(f"| {' | '.join(row)} |" for row in (head, ["---"] * len(head), *cells))


def summary(rows: Sequence[MeasuredDecay]) -> str:
    """Say which presets keep within FACTOR of the medians, and where the others do not."""
    lines = []
    for name in (*made_names(), *table_names()):
        found = ratios(load_material(name), rows_of(name.removeprefix(MADE), rows))
        if found:
            out = [f"{octave} Hz ({r:.2g})" for octave, r in found.items() if not 1 / FACTOR <= r <= FACTOR]
            inside = f"{len(found) - len(out)} of {len(found)} octaves within a factor of two"
            lines.append(f"- `{name}`: {inside}{'; not ' if out else ''}{', '.join(out)}")
    return "\n".join(textwrap.fill(line, 118, subsequent_indent="  ", break_on_hyphens=False) for line in lines)


def page(rows: Sequence[MeasuredDecay]) -> str:
    """Write the page."""
    recorded = [_cells(f"`{name}`", {o: f"{t:.2g}" for o, t in t60_s(load_material(name)).items()})
                for name in recorded_names()]  # fmt: skip
    parts = [
        HEAD.strip(), "## Presets beside medians", summary(rows),
        *(section(name, presets_of(name), rows) for name in table_names()), "## Presets of recordings",
        "Of single bodies; those with lines of their own by these, as of a measured body.", _table(recorded),
    ]  # fmt: skip
    return "\n\n".join(parts) + "\n"


def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0] if __doc__ else "")
    parser.add_argument("--table", type=Path, default=TABLE)
    parser.add_argument("--out", type=Path, default=PAGE)
    asked = parser.parse_args()
    rows = read_table(asked.table)
    asked.out.write_text(page(rows), encoding="utf-8")
    print(summary(rows))


if __name__ == "__main__":
    main()
