"""Commands `modes` and `materials`: a mesh's elastic modes, and the materials of the package."""

from __future__ import annotations

import math
import sys
from dataclasses import dataclass, replace
from pathlib import Path
from typing import TYPE_CHECKING, Any

import numpy as np

from sonic_bullet.apps.cli.output import (
    clean_stdout,
    places,
    print_report,
    status,
    table,
    warn_of_assumed_wall,
    write_json,
)
from sonic_bullet.effects.damping_law import own_decay_per_s
from sonic_bullet.effects.presets_of_effects import with_material
from sonic_bullet.effects.recorded_lines import RecordedLines
from sonic_bullet.files import write_model
from sonic_bullet.files.presets import load_material, warn_of_units
from sonic_bullet.files.uff.writer import ModalShapes, uff_name, write_uff
from sonic_bullet.geometry import oversize
from sonic_bullet.modal import read_mesh
from sonic_bullet.options.modes import ModesOptions
from sonic_bullet.records import Material, ModalModel
from sonic_bullet.records.counts import format_count
from sonic_bullet.records.errors import FileError, MaterialError
from sonic_bullet.records.units import HEARING_LIMIT_HZ
from sonic_bullet.session.body_models import analyse_body
from sonic_bullet.session.tail.statistical_tail import with_tail

if TYPE_CHECKING:
    from sonic_bullet.files.presets import Preset

MADE_HZ = (250, 1000, 4000)
RECORDED_COLUMNS = (
    "name",
    "lines",
    "fitted",
    "held out",
    "predicted",
    "silence",
    "another take",
    "licence",
    "what was struck",
)
"""Columns of the table of recorded presets; takes fitted and held out are counts."""


def run_modes(mesh: str, options: ModesOptions) -> None:
    """Run `modes`; raises SonicBulletError."""
    output, count, to_hz = options.output, options.count, options.mesh.to_hz
    if output is not None and not output.endswith(".npz"):
        raise FileError(f"cannot write {output}: modal models are npz files", "end the name with .npz")
    to, json_to, uff_to = places(output, options.json_to, uff_name(options.uff_to))
    if count is not None and to_hz is not None:
        raise FileError("both --count and --to-hz are given", "give one of them")
    made = chosen_material(options.material, options.youngs_pa, options.poisson, options.density_kg_m3)
    with clean_stdout(json_to) as echo:
        with status(mesh):
            shape = read_mesh(mesh, options.mesh.scale)
            model = analyse_body(
                (shape,),
                with_material(made),
                count=count,
                fixed=options.fixed,
                thickness_m=options.mesh.thickness_m,
                accuracy=options.accuracy,
                to_hz=to_hz or HEARING_LIMIT_HZ,
                tail=False,
            )
            whole = with_tail(model, with_material(made), to_hz or HEARING_LIMIT_HZ)
        solved, model = model, whole if options.tail else model
        if to is not None:
            write_model(to, model)
        if uff_to is not None:
            write_uff(uff_to, _shapes(mesh, made, model))
        more = whole.note[len(solved.note) :].replace("; ", ", ", 1)
        beyond = "" if whole is model else f"with --tail, or tail=True in a scene{more}"
        report = ModesReport(mesh, made, model, output, beyond)
        print_report(report, echo)
    warn_of_assumed_wall(mesh, model.assumed_wall_m)
    if large := oversize(model.vertex_m, model.mass_kg):
        print(
            f"sonic-bullet: warning: {mesh} {large}; "
            "give --scale 0.001 if its numbers are millimetres, 0.01 if they are centimetres",
            file=sys.stderr,
        )
    write_json(json_to, report.to_json())


def _shapes(mesh: str, material: Material, model: ModalModel) -> ModalShapes:
    """Return a model's modes at its vertices, at a modal mass of 1 kg."""
    title = f"{Path(mesh).name}, {material.name}"
    return ModalShapes(model.vertex_m, model.shape, model.freq_hz, model.decay_per_s, 1.0, title)


def chosen_material(
    name: str | None, youngs_pa: float | None, poisson: float | None, density_kg_m3: float | None
) -> Material:
    """Return the named material with the given constants in place of its own; without a name all three or none (steel).

    A material of bare constants has no damping.

    Raises
    ------
    MaterialError
        The name is unknown, or constants are missing or unphysical.
    """
    default_material = "steel"

    given = {"youngs_pa": youngs_pa, "poisson": poisson, "density_kg_m3": density_kg_m3}
    missing = [key for key, value in given.items() if value is None]
    if name is None and 0 < len(missing) < 3:
        options = {"youngs_pa": "--young", "poisson": "--poisson", "density_kg_m3": "--density"}
        raise MaterialError(
            f"{' and '.join(options[key] for key in missing)} missing",
            "give all three of --young, --poisson, --density, or a --material too",
        )
    base = load_material(name or default_material)
    if len(missing) == 3:
        return base
    rho = base.density_kg_m3 if density_kg_m3 is None else density_kg_m3
    if youngs_pa is None and poisson is None:
        made = replace(base, density_kg_m3=rho)
    else:
        elastic = (base.youngs_pa if youngs_pa is None else youngs_pa, base.poisson if poisson is None else poisson)
        made = Material.isotropic("constants", youngs_pa=elastic[0], poisson=elastic[1], density_kg_m3=rho)
        made = made if name is None else replace(base, density_kg_m3=rho, stiffness_pa=made.stiffness_pa)
    warn_of_units(made)
    return made


def run_materials(json_to: str | None) -> None:
    """Run `materials`; raises FileError."""
    made_columns = ("name", "η", "exponent", "spread of ln η", *(f"T60 at {freq_hz} Hz in s" for freq_hz in MADE_HZ))
    from sonic_bullet.files.presets import load_material, made_names, named_preset, recorded_names, table_names

    found = [load_material(name) for name in table_names()]
    made = [(load_material(name), named_preset(name)) for name in made_names()]
    recorded = [(load_material(name), named_preset(name)) for name in recorded_names()]
    if json_to is None:
        head = ("name", "kg/m³", "E in GPa", "ν", "α in 1/s", "β in s", "roughness in µm", "restitution")
        rows = [
            (
                m.name,
                f"{m.density_kg_m3:.0f}",
                f"{m.youngs_pa / 1e9:.3g}",
                f"{m.poisson:.3g}",
                f"{m.alpha_per_s:.4g}",
                f"{m.beta_s:.4g}",
                f"{m.roughness_m * 1e6:.3g}",
                f"{m.restitution:.2f}",
            )
            for m in found
        ]
        print(table(head, rows))
        print("\nas things are made of them: the total loss of measured bodies, all else as above")
        print(table(made_columns, [_made_row(material, preset) for material, preset in made]))
        print("\nof recordings by others: how near the file comes to takes of its object, in dB")
        print(table(RECORDED_COLUMNS, [_recorded_row(preset) for _, preset in recorded]))
        print("\nsources: 'sonic-bullet materials --json' and docs/explanation/materials.md")
    write_json(
        json_to,
        {
            "materials": [_material(m) for m in found],
            "made": [_material(m) | _law_json(preset) for m, preset in made],
            "recorded": [_material(m) | _origin_json(preset) for m, preset in recorded],
        },
    )


def _made_row(material: Material, preset: Preset) -> tuple[str, ...]:
    """Return the table row of a preset of measured bodies."""
    square = (2 * np.pi * np.array(MADE_HZ)) ** 2
    damping = preset.damping
    return (
        preset.name,
        f"{damping.loss_factor:.2g}",
        f"{1.0 if damping.exponent is None else damping.exponent:.2g}",
        f"{damping.spread['loss_factor']:.2g}",
        *(f"{math.log(1000) / d:.2g}" for d in own_decay_per_s(material, square)),
    )


def _law_json(preset: Preset) -> dict[str, Any]:
    """Convert the law of a preset of measured bodies to JSON values."""
    damping = preset.damping
    return {
        "loss_factor": damping.loss_factor,
        "exponent": damping.exponent,
        "floor_s": damping.floor_s,
        "spread": damping.spread,
    }


def _recorded_row(preset: Preset) -> tuple[str, ...]:
    """Return the table row of a recorded preset."""
    origin = preset.provenance.origin if preset.provenance is not None else None
    if origin is None:
        return (preset.name, *("-" for _ in RECORDED_COLUMNS[1:]))
    lines = [one for one in preset.effects if one["id"] == RecordedLines.id]
    other = "-" if origin.other_take_db is None else f"{origin.other_take_db:.1f}"
    return (
        preset.name,
        str(len(lines[0]["freq_hz"])) if lines else "numbers",
        str(origin.takes_fitted),
        str(origin.takes_held_out or "none"),
        f"{origin.predicted_db:.1f}",
        f"{origin.silence_db:.1f}",
        other,
        origin.licence,
        origin.struck,
    )


def _origin_json(preset: Preset) -> dict[str, Any]:
    """Convert the origin of a recorded preset to JSON values."""
    import msgspec

    origin = preset.provenance.origin if preset.provenance is not None else None
    return {"origin": None if origin is None else msgspec.to_builtins(origin)}


def _material(m: Material) -> dict[str, Any]:
    return {
        "name": m.name,
        "density_kg_m3": m.density_kg_m3,
        "youngs_pa": m.youngs_pa,
        "poisson": m.poisson,
        "alpha_per_s": m.alpha_per_s,
        "beta_s": m.beta_s,
        "roughness_m": m.roughness_m,
        "hurst": m.hurst,
        "restitution": m.restitution,
        "source": m.source,
    }


@dataclass(frozen=True, slots=True)
class ModesReport:
    """Report of a mesh's modes. tail: what --tail would add, "" for nothing."""

    mesh: str
    material: Material
    model: ModalModel
    output: str | None
    tail: str = ""

    def to_json(self) -> dict[str, Any]:
        """Return frequencies and decays, and what the mesh is as a body."""
        modes = [
            {"freq_hz": float(f), "decay_per_s": None if math.isnan(d) else float(d)}
            for f, d in zip(self.model.freq_hz, self.model.decay_per_s, strict=True)
        ]
        return {
            "modes": modes,
            "mesh": self.mesh,
            "material": self.material.name,
            "volume_m3": self.model.volume_m3,
            "mass_kg": self.model.mass_kg,
            "vertices": len(self.model.vertex_m),
            "dropped": self.model.dropped,
            "note": self.model.note,
            "output": self.output,
        }

    def lines(self) -> list[str]:
        """Return what the mesh is as a body, and a table of its modes."""
        rows = [
            (str(i), f"{f:.2f}", "-" if math.isnan(d) else f"{d:.3f}")
            for i, (f, d) in enumerate(zip(self.model.freq_hz, self.model.decay_per_s, strict=True), 1)
        ]
        dropped = f", {format_count(self.model.dropped, 'overdamped mode')} dropped" if self.model.dropped else ""
        head = (
            f"{self.mesh}: {self.material.name}, {self.model.volume_m3 * 1e6:.4g} cm³, {self.model.mass_kg:.4g} kg, "
            f"{self.model.mode_count} modes{dropped}\n{self.model.note}"
        )
        modes = [table(("mode", "Hz", "decay in 1/s"), rows)] if rows else []
        return [head.rstrip(), *modes, *([self.tail] if self.tail else [])]
