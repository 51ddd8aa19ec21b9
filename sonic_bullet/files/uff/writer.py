"""Write UFF files, modal shapes at points and their responses, for programs of experimental modal analysis.

nodes -> dataset 15     shapes, f, ζ -> dataset 55, one a mode     responses per N -> dataset 58     SI -> dataset 164
ζ = d/√(ω² + d²) of e^{−dt} cos ωt; dataset 55 has six figures of each number, as single precision has   [SDRL]
"""

from __future__ import annotations

import os
from dataclasses import dataclass
from typing import Any

import numpy as np

from sonic_bullet.files.storage.atomic import replace_file
from sonic_bullet.files.uff.reader import Freedom, pyuff_module
from sonic_bullet.machine.leftovers import temporary_folder
from sonic_bullet.records import Array
from sonic_bullet.records.errors import FileError

TITLE = 80


@dataclass(frozen=True, slots=True, eq=False)
class ModalShapes:
    """Modes at points.

    Parameters
    ----------
    point_m : Array, shape (k, 3)
    shape : Array, shape (k, 3, m)
        Real.
    freq_hz, decay_per_s : Array, shape (m,)
        Damped frequency; decay NaN where it is not known.
    modal_mass_kg
        Of every mode; 0 where shapes have no scale.
    words
        One text a mode, or none at all.
    """

    point_m: Array
    shape: Array
    freq_hz: Array
    decay_per_s: Array
    modal_mass_kg: float
    title: str
    words: tuple[str, ...] = ()


@dataclass(frozen=True, slots=True, eq=False)
class Mobility:
    """Velocity per force (n,) at 0, step_hz, … between two freedoms that have positions."""

    value: Array
    step_hz: float
    strike: Freedom
    sensor: Freedom


def uff_name(path: str | None) -> str | None:
    """Return a valid name for a UFF file unchanged, or None.

    Raises
    ------
    FileError
        It has another extension, or pyuff is missing.
    """
    if path is None:
        return None
    if not path.lower().endswith((".uff", ".unv")):
        raise FileError(f"cannot write {path}: UFF files end in .uff or .unv", "end the name with .uff")
    pyuff_module()
    return path


def write_uff(path: str | os.PathLike[str], shapes: ModalShapes, mobilities: tuple[Mobility, ...] = ()) -> None:
    """Write modal shapes and responses as a UFF file, whole or not at all.

    Parameters
    ----------
    path : path
        A .uff or .unv file.
    shapes : ModalShapes
        Of one body. Its points are nodes 1, 2 and so on.
    mobilities : tuple of Mobility
        Whose nodes follow.

    Raises
    ------
    FileError
        pyuff is not installed, or the file cannot be written.
    """
    pyuff = pyuff_module()
    title = shapes.title.encode("ascii", "replace").decode()[:TITLE] or "NONE"
    sets = [_units(), _nodes(shapes, mobilities)]
    sets += [_mode(shapes, k, title) for k in range(len(shapes.freq_hz))]
    sets += [_function(one, title) for one in mobilities]
    with temporary_folder() as folder:
        made = pyuff.UFF(str(folder / "made.uff"))
        made.write_sets(sets, "overwrite")
        with replace_file(path) as file, (folder / "made.uff").open("rb") as source:
            file.write(source.read())


def _units() -> dict[str, Any]:
    return {
        "type": 164,
        "units_code": 1,
        "units_description": "SI: m, N, s",
        "length": 1.0,
        "force": 1.0,
        "temp": 1.0,
        "temp_offset": 273.15,
    }


def _nodes(shapes: ModalShapes, mobilities: tuple[Mobility, ...]) -> dict[str, Any]:
    """Make dataset 15: the shapes' points, then other positions of the responses."""
    place = {k + 1: tuple(point) for k, point in enumerate(shapes.point_m)}
    for freedom in (f for one in mobilities for f in (one.strike, one.sensor)):
        if freedom.position_m is not None:
            place.setdefault(freedom.node, freedom.position_m)
    x, y, z = (np.array(column, float) for column in zip(*place.values(), strict=True))
    return {"type": 15, "node_nums": list(place), "x": x, "y": y, "z": z}


def _mode(shapes: ModalShapes, k: int, title: str) -> dict[str, Any]:
    """Make dataset 55 of a mode."""
    normal_mode, vector, displacement = 2, 2, 8  # record 6 of dataset 55
    omega, d = 2 * np.pi * float(shapes.freq_hz[k]), float(np.nan_to_num(shapes.decay_per_s[k]))
    words = shapes.words[k] if shapes.words else "NONE"
    return {
        "type": 55,
        "id1": title,
        "id2": words.encode("ascii", "replace").decode()[:TITLE],
        "id4": f"MODE {k + 1}",
        "analysis_type": normal_mode,
        "data_ch": vector,
        "spec_data_type": displacement,
        "load_case": 1,
        "mode_n": k + 1,
        "freq": float(shapes.freq_hz[k]),
        "modal_m": shapes.modal_mass_kg,
        "modal_damp_vis": d / float(np.hypot(omega, d)),
        "node_nums": np.arange(1, len(shapes.point_m) + 1),
        "r1": shapes.shape[:, 0, k].astype(float),
        "r2": shapes.shape[:, 1, k].astype(float),
        "r3": shapes.shape[:, 2, k].astype(float),
    }


def _function(one: Mobility, title: str) -> dict[str, Any]:
    """Make dataset 58 of a response."""
    velocity, force_type, frequency = 11, 13, 18
    return {
        "type": 58,
        "func_type": 4,
        "id1": title,
        "id2": "synthesised of the fitted modes",
        "rsp_node": one.sensor.node,
        "rsp_dir": one.sensor.axis,
        "ref_node": one.strike.node,
        "ref_dir": one.strike.axis,
        "abscissa_spacing": 1,
        "abscissa_spec_data_type": frequency,
        "ordinate_spec_data_type": velocity,
        "orddenom_spec_data_type": force_type,
        "x": one.step_hz * np.arange(len(one.value)),
        "data": np.asarray(one.value, complex),
    }
