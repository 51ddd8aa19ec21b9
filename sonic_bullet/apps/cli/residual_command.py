"""Command `residual`: a preset with the non-modal part of recorded strikes."""

from __future__ import annotations

from dataclasses import asdict, dataclass
from pathlib import Path
from typing import Any

import numpy as np

from sonic_bullet.apps.cli.fit_command import as_case
from sonic_bullet.apps.cli.line_table import take_tables
from sonic_bullet.apps.cli.output import clean_stdout, places, print_report, status, warn, write_json
from sonic_bullet.files import read_channel
from sonic_bullet.files.presets import named_preset, write_preset
from sonic_bullet.files.residual_code import form_of
from sonic_bullet.machine.progress import report_progress
from sonic_bullet.options.fit import ResidualOptions, StrikeOptions
from sonic_bullet.options.option import given_flags
from sonic_bullet.records import Residual
from sonic_bullet.records.counts import format_count
from sonic_bullet.records.errors import AudioError, FileError
from sonic_bullet.records.regular_files import check_regular


def run_residual(source: str, options: ResidualOptions) -> None:
    """Run `residual`; raises SonicBulletError."""
    output, picture, one = options.output, options.picture, options.strike
    if not output.endswith(".json"):
        raise FileError(f"cannot write {output}: presets are JSON files", "end the name with .json")
    if picture is not None and not picture.endswith((".png", ".pdf", ".svg")):
        raise FileError(f"cannot write {picture}: pictures are .png, .pdf or .svg", "end the name with one of them")
    to, picture, json_to = places(output, picture, options.json_to)
    with clean_stdout(json_to) as echo:
        whole = Path(source).is_dir() or Path(source).name == "case.json" or one.mesh is not None
        with status(source):
            preset, strikes, takes = (_residual_with_shape if whole else _residual_without_shape)(source, one)
        write_preset(str(to), preset)
        if picture is not None:
            from sonic_bullet.apps.report.plots.residual_plot import write_residual_picture

            write_residual_picture(picture, strikes)
        report = ResidualReport(source, strikes.residual, takes)
        print_report(report, echo)
    write_json(json_to, report.to_json())


def _residual_with_shape(source: str, one: StrikeOptions) -> tuple[Any, Any, Any]:
    """Return preset, strikes and take distances, with the residual, of a case or a recording of a known shape."""
    import msgspec

    from sonic_bullet.lab.fit.fitted_preset import preset_of
    from sonic_bullet.lab.fit.held_out_takes import predicted_takes
    from sonic_bullet.lab.fit.material_fit import fit_case
    from sonic_bullet.lab.residual.recorded_strikes import case_strikes

    case = as_case(source, one)
    warn(case.warnings)
    if not any(r.split == "fit" and r.file is not None for r in case.recordings):
        raise FileError(
            f"case {case.name} has no 'fit' recording", "a residual is what a recording has beside its object's modes"
        )
    found = fit_case(case)
    warn(found.warnings)
    report_progress("taking what is left")
    strikes = case_strikes(found)
    takes = predicted_takes(found, residual=strikes.residual)
    return msgspec.structs.replace(preset_of(found), residual=form_of(strikes.residual)), strikes, takes


def _residual_without_shape(source: str, one: StrikeOptions) -> tuple[Any, Any, Any]:
    """Return preset and strikes of a recording without a shape: a named material, with features in place of modes."""
    import msgspec

    from sonic_bullet.lab.residual.recorded_strikes import recording_strikes

    known = ("--onset", "--channel", "--material")
    given = [flag for flag in given_flags(one) if flag not in known]
    if given:
        raise FileError(f"{' and '.join(given)} given without a shape", "give --mesh too, or leave it out")
    if one.material is None:
        raise FileError("--material missing", "without --mesh the residual joins a material that is known: name it")
    preset = named_preset(one.material)
    check_regular(source)
    if not Path(source).is_file():
        raise FileError(
            f"cannot read {source}: no such file or folder", "give a recording, or a folder with a case.json"
        )
    observed, sr, which = read_channel(source, one.channel)
    warn(f"{source}: {words}" for words in [which] if words)
    report_progress("looking for modes")
    try:
        strikes = recording_strikes(observed, sr, one.onset_s, Path(source).name)
    except AudioError as error:
        raise AudioError(f"{source}: {error.what}", error.remedy) from error
    return msgspec.structs.replace(preset, residual=form_of(strikes.residual)), strikes, ()


@dataclass(frozen=True, slots=True)
class ResidualReport:
    """Report of the residual of a source, and of how near the preset's takes are with it."""

    source: str
    residual: Residual
    takes: tuple[Any, ...]

    def to_json(self) -> dict[str, Any]:
        """Return the figures of the residual and the takes."""
        lines = zip(
            self.residual.line_freq_hz, self.residual.line_decay_per_s, self.residual.line_amplitude, strict=True
        )
        share = self.residual.share_of_clip
        return {
            "residual_of_clip_db": 10 * float(np.log10(share)) if share > 0 else None,
            "modes": len(self.residual.mode_freq_hz),
            "lines": [{"freq_hz": float(f), "decay_per_s": float(d), "amplitude": float(a)} for f, d, a in lines],
            "noise_cells": int((self.residual.power_per_hz > 0).sum()),
            "noise_s": float(self.residual.time_s[-1]) if self.residual.power_per_hz.any() else 0.0,
            "source": self.residual.source,
            "takes": [asdict(take) for take in self.takes],
        }

    def lines(self) -> list[str]:
        """Return how much there is beside the modes, and the takes."""
        shown = self.to_json()
        level = shown["residual_of_clip_db"]
        loud = "nothing" if level is None else f"{level:.1f} dB of the recordings' energy"
        return [
            f"{self.source}: beside {format_count(shown['modes'], 'mode')} there is {loud}: "
            f"{format_count(len(shown['lines']), 'line')}, and noise in "
            f"{shown['noise_cells']} cells of band and time",
            *take_tables(self.takes),
        ]
