"""Command `fit`: fit a preset to a recorded strike, or a case of them.

Exit 0: fitted; 1: the fit is farther from the takes than silence; 2: as for all commands.
"""

from __future__ import annotations

from dataclasses import asdict, dataclass, replace
from pathlib import Path
from typing import Any

import click
import numpy as np

from sonic_bullet.apps.cli.line_table import decay_cells, decay_values, finite, take_tables, write_csv
from sonic_bullet.apps.cli.output import clean_stdout, places, print_report, status, table, warn, write_json
from sonic_bullet.files.case_fields import LARGEST_NUMBER
from sonic_bullet.files.cases import Case, CaseObject, CaseRecording, dimension_tolerance, medium_of, read_case
from sonic_bullet.files.presets import load_material, write_preset
from sonic_bullet.files.storage.atomic import replace_file
from sonic_bullet.files.uff.writer import uff_name, write_uff
from sonic_bullet.options.fit import FitOptions, StrikeOptions
from sonic_bullet.options.option import given_flags
from sonic_bullet.options.render import Point
from sonic_bullet.records import Array
from sonic_bullet.records.counts import format_count
from sonic_bullet.records.errors import FileError
from sonic_bullet.records.regular_files import check_regular


def run_fit(source: str, options: FitOptions) -> None:
    """Run `fit`; raises SonicBulletError."""
    output, picture, page = options.output, options.picture, options.page
    fit_columns = (
        "object",
        "freq_hz",
        "freq_sd_hz",
        "decay_per_s",
        "decay_sd_per_s",
        "t60_s",
        "t60_sd_s",
        "loss_factor",
        "loss_factor_sd",
        "q",
        "q_sd",
        "mode_hz",
    )
    if not output.endswith(".json"):
        raise FileError(f"cannot write {output}: presets are JSON files", "end the name with .json")
    if picture is not None and not picture.endswith((".png", ".pdf", ".svg")):
        raise FileError(f"cannot write {picture}: pictures are .png, .pdf or .svg", "end the name with one of them")
    if page is not None and not page.endswith((".html", ".htm")):
        raise FileError(f"cannot write {page}: it is a page", "end the name with .html")
    to, picture, page, json_to, csv_to, uff_to = places(
        output, picture, page, options.json_to, options.csv_to, uff_name(options.uff_to)
    )
    case = _with_tolerance(as_case(source, options.strike), options.tolerance_percent)
    warn(case.warnings)
    with clean_stdout(json_to) as echo:
        from sonic_bullet.lab.fit.fitted_preset import preset_of
        from sonic_bullet.lab.fit.material_fit import fit_case

        with status(source):
            found = fit_case(case)
        if uff_to is not None:
            from sonic_bullet.lab.fit.modal_shapes import mobilities, modal_shapes

            shapes = modal_shapes(found)
            write_uff(uff_to, shapes, mobilities(found, shapes))
        preset = preset_of(found)
        write_preset(str(to), preset)
        if picture is not None:
            from sonic_bullet.apps.report.plots.fit_plot import write_fit_picture

            write_fit_picture(picture, found)
        if page is not None:
            from sonic_bullet.apps.bake.page.fitted_bodies import fitted_page

            with status(page):
                text = fitted_page(found)
            if not text:
                raise FileError(f"cannot write {page}: no body of {case.name} has a shape to strike", "give it a mesh")
            with replace_file(page) as file:
                file.write(text.encode())
        report = FitReport(found, preset)
        print_report(report, echo)
    warn(found.warnings)
    write_csv(csv_to, report.line_rows(), fit_columns)
    write_json(json_to, report.to_json())
    if found.worse_than_silence:
        raise click.exceptions.Exit(1)


def _with_tolerance(case: Case, percent: float | None) -> Case:
    """Return the case with the dimension tolerance of an option in place of its own; raises FileError."""
    if percent is None:
        return case
    tolerance = dimension_tolerance(percent / 100, "--dimension-tolerance")
    things = {name: replace(thing, dimension_tolerance=tolerance) for name, thing in case.objects.items()}
    return replace(case, objects=things)


def as_case(source: str, one: StrikeOptions) -> Case:
    """Return the case in a folder, or the one the options describe.

    Raises
    ------
    FileError
        The source cannot be read, or options are missing or wrong.
    """
    path = Path(source)
    if path.is_dir() or path.name == "case.json":
        if given := given_flags(one):
            raise FileError(f"{' and '.join(given)} given beside a case", "a case says that itself; leave it out")
        return read_case(path)
    check_regular(path)
    if not path.is_file():
        raise FileError(
            f"cannot read {source}: no such file or folder", "give a recording, or a folder with a case.json"
        )
    if one.scale is not None and not np.isfinite(one.scale):
        raise FileError(f"--scale is {one.scale}", "give a finite number")
    if one.impulse is not None and one.impulse > LARGEST_NUMBER:
        raise FileError(f"--impulse is {one.impulse:g} N·s", f"give it in N·s, at most {LARGEST_NUMBER:g}")
    missing = [f"--{name}" for name in ("mesh", "strike", "material") if getattr(one, name) is None]
    if missing:
        raise FileError(
            f"{' and '.join(missing)} missing",
            f"give {'it' if len(missing) == 1 else 'them'}, or make a case of the recording, "
            "which may leave them open: 'sonic-bullet case new'",
        )

    assert one.mesh is not None and one.material is not None
    check_regular(one.mesh)
    if not Path(one.mesh).is_file():
        raise FileError(f"mesh file '{one.mesh}' does not exist", "check the path")
    load_material(one.material)
    kind = one.sensor or "pressure"
    if kind == "velocity" and one.sensor_at is None:
        raise FileError("--sensor velocity needs a place", "give --sensor-at X,Y,Z")
    if kind != "velocity" and one.sensor_direction is not None:
        raise FileError(
            f"--sensor-direction is given, but --sensor is {kind}", "give --sensor velocity, or leave the direction out"
        )
    thing = CaseObject("object", Path(one.mesh), 1.0 if one.scale is None else one.scale, one.material, fixed=one.fixed)
    struck = one.strike, _unit("direction", one), one.impulse
    recording = CaseRecording(path, None, "object", "fit", *struck, one.channel)
    at = {"object": one.sensor_at} if one.sensor_at is not None else None
    along = _unit("sensor_direction", one)
    direction = None if along is None else {"object": along}
    medium = medium_of(one.medium, kind)
    return Case(
        path.stem,
        path.parent,
        {"object": thing},
        (recording,),
        kind,
        at,
        direction,
        onset_s=one.onset_s,
        medium=medium,
    )


def _unit(name: str, one: StrikeOptions) -> Point | None:
    """Normalise an option's direction; raises FileError."""
    direction: Point | None = getattr(one, name)
    if direction is None:
        return None
    length = float(np.linalg.norm(direction))
    if not length > 0:
        raise FileError(f"--{name.replace('_', '-')} is zero", "give a direction")
    return (direction[0] / length, direction[1] / length, direction[2] / length)


@dataclass(frozen=True, slots=True)
class FitReport:
    """Report of a `CaseFit` and of the preset made of it."""

    found: Any
    preset: Any

    def to_json(self) -> dict[str, Any]:
        """Return parameters, lines and takes; None where not identifiable."""
        from sonic_bullet.lab.fit.takes.next_measurement import next_measurement

        fit = self.found.fit
        return {
            "alpha_per_s": fit.alpha_per_s,
            "beta_s": fit.beta_s,
            "gamma_m2_s2": fit.gamma_m2_s2 if self.found.has_material else None,
            "sigma": fit.sigma,
            "poisson_ratio": fit.poisson_ratio if self.found.has_material else None,
            "covariance": [[float(x) if np.isfinite(x) else None for x in row] for row in fit.covariance],
            "dimension_tolerance": self.found.dimension_tolerance,
            "verdict": fit.verdict,
            "log_spectral_db": self.found.log_spectral_db if self.found.log_spectral_db >= 0 else None,
            "takes": [asdict(take) for take in self.found.takes],
            "next_measurement": next_measurement(self.found),
            "modes": [
                {"freq_hz": float(f), "decay_per_s": float(d), "amplitude": float(a)}
                for f, d, a in zip(fit.freq_hz, fit.decay_per_s, fit.amplitude, strict=True)
            ],
            "lines": self.line_rows(),
        }

    def lines(self) -> list[str]:
        """Return verdict, parameters, paired lines, takes and what to measure next."""
        from sonic_bullet.lab.fit.dimension_tolerance import GAMMA_PER_SCALE, lines_sd
        from sonic_bullet.lab.fit.takes.next_measurement import next_measurement

        fit, elasticity, damping = self.found.fit, self.preset.elasticity, self.preset.damping
        sd = np.sqrt(np.diag(fit.covariance))

        def shown(value: float, spread: float, relative: bool = True) -> tuple[str, str]:
            known = f"{spread * (value if relative else 1):.2g}" if np.isfinite(spread) else "not identifiable"
            return f"{value:.6g}", known

        rows = [("alpha in 1/s", *shown(damping.alpha_per_s, sd[0])), ("beta in s", *shown(damping.beta_s, sd[1]))]
        if np.isnan(sd[:2]).all():
            rows = [(name, value, "not identifiable: the guess's") for name, value, _ in rows]
        elif np.isnan(sd[:2]).any():  # the pair meets the decays that were heard, whichever of them tells
            open_one = int(np.isnan(sd[1]))
            rows[open_one] = (*rows[open_one][:2], f"not identifiable: fitted with {('beta', 'alpha')[open_one]}")
        rows += [
            ("E/density in m²/s²", *shown(elasticity.youngs_pa / self.found.density_kg_m3, sd[2])),
            ("E in Pa", *shown(elasticity.youngs_pa, sd[2])),
            ("density in kg/m³", f"{self.found.density_kg_m3:.6g}", "the guess's"),
            ("Poisson's ratio", *shown(elasticity.poisson, sd[4], False)),
            ("sigma", *shown(fit.sigma, sd[3])),
        ] * self.found.has_material
        paired = sum(int((o.line >= 0).sum()) for o in self.found.objects)
        lines = sum(len(e.lines.freq_hz) for e in self.found.evidence)
        correction: Array = (
            np.concatenate([o.correction[o.line >= 0] for o in self.found.objects])
            if self.found.objects
            else np.zeros(0)
        )
        text = [
            f"{self.found.case.name}: {fit.verdict}",
            table(("", "value", "spread"), rows),
            f"{format_count(paired, 'mode')} paired with {format_count(lines, 'observed line')}",
        ]
        tolerance = self.found.dimension_tolerance
        if np.isfinite(sd[2]) and tolerance:
            own = lines_sd(fit.covariance, tolerance)
            text.append(
                f"spread of E: lines {own:.2g}, dimensions {GAMMA_PER_SCALE * tolerance:.2g} of it, "
                f"as they are known to {tolerance:.2%} (--dimension-tolerance)"
            )
            if np.isfinite(sd[4]):
                known, every = self.found.poisson_sd_of_dimensions, sd[4]
                text.append(
                    f"spread of Poisson's ratio: lines {np.sqrt(max(every**2 - known**2, 0.0)):.2g}, each dimension "
                    f"wrong on its own {known:.2g}"
                )
        if not self.found.has_material:
            text.append(
                "the preset plays the observed lines; all else in it is steel's, as nobody says what was struck"
            )
        elif self.preset.provenance.assumed:
            text.append(f"assumed: {'; '.join(self.preset.provenance.assumed)}")
        cells = [
            (f"{row['freq_hz']:.2f}", f"{row['mode_hz']:.2f}", f"{row['decay_per_s'] or np.nan:.3g}", *decay_cells(row))
            for row in self.line_rows()
            if row["mode_hz"] is not None
        ]
        if cells:
            text.append(table(("line Hz", "mode Hz", "decay 1/s", "T60 s", "loss factor", "Q"), cells))
        if len(correction):
            text.append(
                f"corrections of single modes' frequencies: rms {np.sqrt((correction**2).mean()):.2%}, largest "
                f"{np.abs(correction).max():.2%}"
            )
        if self.found.log_spectral_db >= 0:
            text.append(f"log-spectral distance of recording and synthesis: {self.found.log_spectral_db:.2f} dB")
        text += take_tables(self.found.takes)
        if said := next_measurement(self.found):
            text.append(f"next: {said}")
        return text

    def line_rows(self) -> list[dict[str, Any]]:
        """Return a row an observed line, by object: frequency, decay, T60, η and Q with spreads, and its fitted mode.

        mode_hz is None where no mode is paired with the line.
        """
        rows = []
        shaped = {o.evidence.thing.name: o for o in self.found.objects}
        for e in self.found.evidence:
            lines, o = e.lines, shaped.get(e.thing.name)
            mode = (
                {}
                if o is None
                else dict(zip(o.line[o.line >= 0].tolist(), o.freq_hz[o.line >= 0].tolist(), strict=True))
            )
            for k in range(len(lines.freq_hz)):
                freq, decay, sd = lines.freq_hz[k], lines.decay_per_s[k], lines.identified_sd_per_s[k]
                own = {"freq_hz": freq, "freq_sd_hz": lines.freq_sd_hz[k], "decay_per_s": decay, "decay_sd_per_s": sd}
                rows.append(
                    {"object": e.thing.name}
                    | {name: finite(value) for name, value in own.items()}
                    | decay_values(freq, decay, sd)
                    | {"mode_hz": mode.get(k)}
                )
        return rows
