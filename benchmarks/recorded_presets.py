"""Presets that ship with the package and were made of recordings by others: each by the product's own commands.

    python -m benchmarks.recorded_presets NAME --data ../shared/measured [--out FOLDER]
    python -m benchmarks.recorded_presets --table

DATA/SET/case.json -> takes cut out of the set's files, every second one held out
    -> `case new` -> `fit`, `residual` -> what the set's licence allows, each number as far as its spread goes
    -> the file's own distance from the takes held out, beside silence and another take -> FOLDER/NAME.json

Of a set under CC0 or MIT: lines and residual. Of a set with a mesh: numbers alone, E/ρ, ν and the loss, as measured
facts; what is held against its takes are the mesh's modes with these numbers. A preset that is not nearer than silence
is not written, exit 1. --table prints the rows of docs/explanation/materials.md.
"""

from __future__ import annotations

import argparse
import csv
import json
import re
import subprocess
import sys
import tempfile
from collections.abc import Callable
from dataclasses import replace
from pathlib import Path
from typing import Any

import msgspec
import numpy as np
import soundfile

from benchmarks.recorded_numbers import Rows, ringing_modes, rounded, with_numbers
from benchmarks.recorded_objects import OBJECTS, Struck
from sonic_bullet.effects.presets_of_effects import to_preset
from sonic_bullet.effects.recorded_lines import RecordedLines
from sonic_bullet.engine.residual.offline import residual_sound
from sonic_bullet.files.cases import Case, CaseRecording, read_case
from sonic_bullet.files.presets import (
    RECORDED_FOLDER,
    Origin,
    Preset,
    material_of,
    named_preset,
    read_preset,
    recorded_names,
    write_preset,
)
from sonic_bullet.files.residual_code import residual_of
from sonic_bullet.lab.fit.material_fit import fit_case
from sonic_bullet.lab.fit.prediction_of_lines import damped_sum
from sonic_bullet.lab.fit.recorded import recorded_signals
from sonic_bullet.lab.fit.takes.best_gain import find_best_gain
from sonic_bullet.lab.fit.takes.plausible_preset import plausible_sound
from sonic_bullet.records import Array
from sonic_bullet.signal.log_spectral import floor_between, power_spectra

HOLD_OUT = 2
STANDARD_ERRORS = 3.0
"""That a line's decay lies above none at least: what does not decay is hum, or a tone of who recorded it."""


def made_case(name: str, thing: Struck, data: Path, folder: Path) -> tuple[str, ...]:
    """Write the case of an object; its takes in words. Raises SystemExit where the set is not there."""
    takes = thing.takes(data / thing.set)
    if not takes:
        raise SystemExit(f"{data / thing.set} holds no takes of {name}")
    folder.mkdir()
    for k, (path, start, stop) in enumerate(takes):
        sound, sr = soundfile.read(path, always_2d=True)
        soundfile.write(
            folder / f"take{k}.wav", sound[max(0, round(start * sr)) : round(stop * sr), 0], sr, subtype="FLOAT"
        )
    mesh = () if thing.mesh is None else ("--mesh", str(data / thing.set / thing.mesh))
    hold_out = ("--hold-out", str(HOLD_OUT)) if len(takes) > 1 else ()
    command("case", "new", str(folder), "--material", thing.guess, *mesh, *hold_out)
    if thing.band_hz is not None:
        case = json.loads((folder / "case.json").read_text())
        (folder / "case.json").write_text(json.dumps(case | {"band_hz": thing.band_hz}, indent=1))
    return tuple(f"{path.name}, {max(start, 0):.2f} to {stop:.2f} s" for path, start, stop in takes)


def command(*words: str) -> None:
    """Run a command. Raises SystemExit with its last line where it fails."""
    run = [sys.executable, "-m", "sonic_bullet", *words]
    done = subprocess.run(run, check=False, capture_output=True, text=True, timeout=600)
    if done.returncode:
        raise SystemExit((done.stderr.strip().splitlines() or ["no word"])[-1])


def lines_of(path: Path, top_hz: float) -> Rows:
    """The lines that `fit --csv` wrote, that decay, and that lie within a band that ends at ``top_hz``: a line d 1/s
    wide is 16 dB below its peak d Hz away, and what the band's end cuts nearer than that is known by nothing.
    """
    with path.open(newline="") as file:
        rows = [{k: float(v) for k, v in row.items() if k != "object" and v} for row in csv.DictReader(file)]
    known = [row for row in rows if {"freq_sd_hz", "decay_per_s", "decay_sd_per_s"} <= set(row)]
    return [
        row
        for row in known
        if row["decay_per_s"] >= STANDARD_ERRORS * row["decay_sd_per_s"]
        and row["freq_hz"] + row["decay_per_s"] < top_hz
    ]


def with_lines(preset: Preset, rows: Rows) -> Preset:
    """A preset with those of its lines and of its residual's modes that decay, each number as far as it is known."""
    lines = next(one for one in preset.effects if one["id"] == RecordedLines.id)
    known_hz = np.array([row["freq_hz"] for row in rows])
    near = {f: int(np.argmin(np.abs(known_hz - f))) for f in lines["freq_hz"]}
    keep = [k for k, f in enumerate(lines["freq_hz"]) if abs(known_hz[near[f]] - f) < 1e-6 * f]
    freq = [lines["freq_hz"][k] for k in keep]
    error = [rows[near[f]] for f in freq]
    effect = RecordedLines(
        tuple(rounded(f, e["freq_sd_hz"], 6) for f, e in zip(freq, error, strict=True)),
        tuple(rounded(lines["decay_per_s"][k], e["decay_sd_per_s"]) for k, e in zip(keep, error, strict=True)),
        tuple(rounded(lines["amplitude"][k]) for k in keep),
        tuple(round(lines["spread_db"][k], 1) for k in keep),
    )
    residual = preset.residual
    if residual is not None:
        mode = [k for k, f in enumerate(residual.mode_freq_hz) if min(abs(f - x) for x in freq) < 1e-6 * f]
        changed = {
            name: tuple(rounded(getattr(residual, name)[k], digits=n) for k in mode)
            for name, n in (("mode_freq_hz", 6), ("mode_decay_per_s", 3), ("mode_amplitude", 3))
        } | {name: tuple(rounded(x, digits=5) for x in getattr(residual, name)) for name in ("freq_hz", "time_s")}
        residual = msgspec.structs.replace(
            residual, **changed, loudest_per_hz=rounded(residual.loudest_per_hz),
            clip_energy=rounded(residual.clip_energy), source=preset.name,
        )  # fmt: skip
    shares = [np.median([row[sd] / row[value] for row in error]) for value, sd in RELATIVE]
    note = (
        f"{len(freq)} lines of one object as it was held and where it was recorded; standard errors, at the median: "
        f"frequency {shares[0]:.1g}, decay {shares[1]:.1g} of the number"
    )
    return msgspec.structs.replace(preset, effects=(to_preset(effect),), residual=residual, note=note)


RELATIVE = (("freq_hz", "freq_sd_hz"), ("decay_per_s", "decay_sd_per_s"))


def mean_distance_db(case: Case, split: str, made: Callable[[CaseRecording, int, int], Array]) -> float:
    """The mean distance of a split's takes from what is made of each for (n,) samples at a rate, at the best gain."""
    (thing,) = case.objects.values()
    takes = tuple(r for r in case.recordings if r.split == split)
    signals, sr = recorded_signals(case, thing, takes)
    found = []
    for take, signal in zip(takes, signals, strict=True):
        floor = floor_between([signal]).within(sr, case.band_hz)
        sound = power_spectra(made(take, len(signal), sr))
        found.append(find_best_gain(power_spectra(signal), sound, floor).distance_db)
    return float(np.mean(found))


def lines_distance_db(preset: Preset, folder: Path, split: str) -> float:
    """Of the lines and the residual that a file holds."""
    lines = next(one for one in preset.effects if one["id"] == RecordedLines.id)
    freq, decay, size = (np.array(lines[name]) for name in ("freq_hz", "decay_per_s", "amplitude"))
    assert preset.residual is not None
    residual = residual_of(preset.residual)

    def made(_: CaseRecording, n: int, sr: int) -> Array:
        return damped_sum(freq, decay, size, n, sr) + residual_sound(residual, freq, decay, size, n, sr)

    return mean_distance_db(read_case(folder), split, made)


def numbers_distance_db(preset: Preset, folder: Path, split: str) -> float:
    """Of the modes of the object's mesh with the numbers that a file holds."""
    found = fit_case(read_case(folder))
    struck = replace(found.evidence[0], guess=material_of(preset))

    def made(take: CaseRecording, n: int, sr: int) -> Array:
        sound = plausible_sound(found, struck, take, n, sr)
        assert sound is not None
        return sound

    return mean_distance_db(found.case, split, made)


def mean_of(takes: list[dict[str, Any]], key: str) -> float | None:
    values = [take[key] for take in takes if take[key] is not None]
    return round(float(np.mean(values)), 1) if values else None


def made_preset(name: str, data: Path) -> Preset:
    """The preset of an object. Raises SystemExit where a command fails, or where it is no nearer than silence."""
    thing = OBJECTS[name]
    with tempfile.TemporaryDirectory() as place:
        folder, said = Path(place) / name, Path(place) / "said.json"
        words = made_case(name, thing, data, folder)
        to, table = str(Path(place) / "preset.json"), Path(place) / "lines.csv"
        command("fit", str(folder), "-o", to, "--json", str(said), "--csv", str(table))
        if thing.mesh is None:
            command("residual", str(folder), "-o", to, "--json", str(said))
        preset, rows = (
            msgspec.structs.replace(read_preset(to), name=name),
            lines_of(table, read_case(folder).band_hz[1]),
        )
        if thing.mesh is None:
            preset = with_lines(preset, rows)
        else:
            seconds = min(soundfile.info(take).duration for take in folder.glob("*.wav"))
            preset = with_numbers(preset, ringing_modes(rows, seconds), thing)
        takes = json.loads(said.read_text())["takes"]
        split = takes[0]["split"]
        distance_db = (lines_distance_db if thing.mesh is None else numbers_distance_db)(preset, folder, split)
        fits = [w for w, r in zip(words, read_case(folder).recordings, strict=True) if r.split == "fit"]
    predicted, silence = round(distance_db, 1), mean_of(takes, "silence_db") or 0.0
    if predicted >= silence:
        raise SystemExit(f"{name}: {predicted} dB from its takes, silence {silence} dB: not written")
    played = "lines and residual" if thing.mesh is None else "modes of the object's mesh with these numbers"
    against = "takes held out" if split == "holdout" else "the takes fitted, for none was held out"
    origin = Origin(
        struck=thing.struck, command=f"python -m benchmarks.recorded_presets {name} --data ../shared/measured",
        source=thing.source, licence=thing.licence, takes_fitted=len(fits), takes_held_out=len(words) - len(fits),
        distance=f"{played}, at the best gain, against {against}", predicted_db=predicted, silence_db=silence,
        other_take_db=mean_of(takes, "other_take_db"),
    )  # fmt: skip
    return with_origin(preset, origin, tuple(fits), thing)


def with_origin(preset: Preset, origin: Origin, recordings: tuple[str, ...], thing: Struck) -> Preset:
    """A preset with its origin; sources name what was taken from the guess, and parameters what was fitted."""
    fitted = preset.provenance
    assert fitted is not None
    spreads = {k: rounded(s, digits=2) for k, s in fitted.spreads.items() if s is not None}
    if thing.mesh is not None:  # its loss is the law of its modes
        spreads = {k: s for k, s in spreads.items() if k in ("gamma_m2_s2", "poisson_ratio")}
    parameters = {k: rounded(v, spreads[k], 4) for k, v in fitted.parameters.items() if k in spreads}
    provenance = msgspec.structs.replace(
        fitted, recordings=recordings, parameters=parameters, spreads=spreads, correction={}, origin=origin
    )
    if thing.mesh is not None:
        return msgspec.structs.replace(preset, provenance=provenance)
    guess = named_preset(thing.guess)
    damping = preset.damping
    if damping.alpha_per_s is not None and damping.beta_s is not None:
        alpha, beta = rounded(damping.alpha_per_s), rounded(damping.beta_s)
        taken = "beta_s" not in spreads and "alpha_per_s" not in spreads
        source = f"taken from '{thing.guess}'" if taken else "fitted"
        damping = msgspec.structs.replace(
            damping, alpha_per_s=alpha, beta_s=beta, source=f"{source}; each line has its own decay"
        )
    elasticity = msgspec.structs.replace(
        preset.elasticity, youngs_pa=guess.elasticity.youngs_pa, poisson=guess.elasticity.poisson, note="",
        source=f"taken from '{thing.guess}': no shape was measured",
    )  # fmt: skip
    return msgspec.structs.replace(preset, elasticity=elasticity, damping=damping, provenance=provenance)


def write_compactly(path: Path, preset: Preset) -> None:
    """Write a preset, each list of numbers on one line."""
    write_preset(path, preset)
    written = read_preset(path)
    text = path.read_text(encoding="utf-8")
    numbers = re.compile(r"\[\s+([-\d.eE+,\s]+?)\s+\]")
    path.write_text(numbers.sub(lambda m: f"[{' '.join(m[1].split())}]", text), encoding="utf-8")
    assert read_preset(path) == written


def table_rows() -> list[str]:
    """The rows of docs/explanation/materials.md."""
    rows = []
    for name in recorded_names():
        fitted = named_preset(name).provenance
        assert fitted is not None
        assert fitted.origin is not None
        o = fitted.origin
        held = "none" if not o.takes_held_out else str(o.takes_held_out)
        other = "–" if o.other_take_db is None else f"{o.other_take_db:.1f}"
        cells = (f"`{name}`", o.struck, f"{o.takes_fitted}, {held}", f"{o.predicted_db:.1f}", f"{o.silence_db:.1f}",
                 other, o.source, o.licence)  # fmt: skip
        rows.append(f"| {' | '.join(cells)} |")
    return rows


def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0] if __doc__ else "")
    parser.add_argument("names", nargs="*", metavar="NAME", help=f"some of {', '.join(OBJECTS)}; all without one")
    parser.add_argument("--data", type=Path, help="folder of the sets")
    parser.add_argument("--out", type=Path, default=RECORDED_FOLDER)
    parser.add_argument("--table", action="store_true", help="print the rows of the page of materials, make nothing")
    asked = parser.parse_args()
    if asked.table:
        print("\n".join(table_rows()))
        return
    if asked.data is None or not set(asked.names) <= set(OBJECTS):
        parser.error(f"give --data, and names among {', '.join(OBJECTS)}")
    asked.out.mkdir(parents=True, exist_ok=True)
    for name in asked.names or OBJECTS:
        preset = made_preset(name, asked.data)
        write_compactly(asked.out / f"{name}.json", preset)
        print(f"{name}: {(asked.out / f'{name}.json').stat().st_size} bytes", flush=True)


if __name__ == "__main__":
    main()
