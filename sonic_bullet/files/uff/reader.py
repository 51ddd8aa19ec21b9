"""Read UFF files: measured functions at points of a structure, in SI units.

    bytes -> whole? -> pyuff -> 58 functions -> Response      15, 2411 nodes -> places     164 units -> factors to SI
                             -> what is not understood -> one line each, by kind, with a count

Source of the layout: the file formats of the Structural Dynamics Research Laboratory, University of Cincinnati, which
pyuff prints (`pyuff.UFF.get_supported_sets`, `pyuff.get_structure_58`).
"""

from __future__ import annotations

import os
import re
from collections import Counter
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import numpy as np

from sonic_bullet.files.case_fields import LARGEST_NUMBER
from sonic_bullet.files.storage.reading import reading_file
from sonic_bullet.records import Array
from sonic_bullet.records.errors import FileError

READ_DATASETS = (15, 58, 164, 2411)
FORCE_TYPES = (9, 13)
Point = tuple[float, float, float]


@dataclass(frozen=True, slots=True)
class Freedom:
    """Degree of freedom of a function: a node with a direction.

    Parameters
    ----------
    axis
        ±1 to ±3, 0 for a scalar.
    position_m
        None where the file does not give it.
    """

    node: int
    axis: int
    position_m: Point | None

    @property
    def direction(self) -> Point | None:
        """Unit vector of its axis, or None."""
        if not 1 <= abs(self.axis) <= 3:
            return None
        unit = [0.0, 0.0, 0.0]
        unit[abs(self.axis) - 1] = 1.0 if self.axis > 0 else -1.0
        return unit[0], unit[1], unit[2]


@dataclass(frozen=True, slots=True, eq=False)
class Response:
    """One function: value (n,) from ``start`` by ``step``, complex over Hz (spectral) or real over s.

    Parameters
    ----------
    quantity
        Displacement, velocity, acceleration or pressure, SI.
    per_force
        Divided by a force: per N over frequency, per N·s over time.
    """

    quantity: str
    spectral: bool
    per_force: bool
    start: float
    step: float
    value: Array
    strike: Freedom
    sensor: Freedom


@dataclass(frozen=True, slots=True, eq=False)
class UffFile:
    """The functions of a file, and a line for each kind of content that was not understood."""

    responses: tuple[Response, ...]
    notes: tuple[str, ...]


def pyuff_module() -> Any:
    """Import the package that reads and writes UFF; FileError where it is not installed."""
    try:
        import pyuff
    except ImportError as error:
        raise FileError(f"UFF files need pyuff: {error}", 'pip install "sonic_bullet[uff]"') from None
    return pyuff


def read_uff(path: str | os.PathLike[str]) -> UffFile:
    """Read the functions of a UFF file.

    Parameters
    ----------
    path : path
        A .uff or .unv file, text or binary (58b).

    Returns
    -------
    UffFile
        Frequency responses and time records, with the places that datasets 15 and 2411 give.

    Raises
    ------
    FileError
        pyuff is not installed; the file is missing, cut or not UFF; none of its functions is understood.
    """
    pyuff = pyuff_module()
    with reading_file(path, "UFF file", FileError, "export it again"):
        _refuse_cut(Path(path))
        file = pyuff.UFF(os.fspath(path))
        kinds = [int(kind) for kind in file.get_set_types()]
        sets = [(kind, _dataset(file, i, kind)) for i, kind in enumerate(kinds) if kind in READ_DATASETS]
        return _understood(sets, kinds, path)


def _understood(sets: list[tuple[int, dict[str, Any]]], kinds: list[int], path: str | os.PathLike[str]) -> UffFile:
    """Convert the datasets of a file; FileError where none is a response."""
    metre, newton = _factors([one for kind, one in sets if kind == 164])
    nodes = _nodes([one for kind, one in sets if kind in (15, 2411)], metre)
    found: list[Response] = []
    unread: Counter[str] = Counter()
    assumed = 0
    for one in (one for kind, one in sets if kind == 58):
        response = _response(one, nodes, (metre, newton), path)
        if isinstance(response, str):
            unread[response] += 1
        else:
            found.append(response)
            assumed += response.spectral and int(one.get("orddenom_spec_data_type", 0)) not in FORCE_TYPES
    if not found:
        held = (
            ", ".join(_count_unread(unread)) or ", ".join(f"dataset {k}" for k in dict.fromkeys(kinds)) or "no dataset"
        )
        raise FileError(f"{path} holds no response that is understood ({held})", "export frequency responses to force")
    return UffFile(tuple(found), tuple(_notes(found, unread, kinds, assumed)))


def _dataset(file: Any, number: int, kind: int) -> dict[str, Any]:
    """Read a dataset by pyuff; raises FileError."""
    try:
        with np.errstate(all="ignore"):  # of NaN values, which are refused below
            found: dict[str, Any] = file.read_sets(number)
    except Exception as error:
        raise FileError(
            f"dataset {kind}, number {number + 1} of the file, is cut or spoiled", "export it again"
        ) from error
    return found


def _refuse_cut(path: Path) -> None:
    """Raise FileError where a file is not UFF, or ends inside a dataset, which pyuff would omit."""
    bytes_max = 1 << 30
    if path.is_file() and path.stat().st_size > bytes_max:
        raise FileError(f"{path} is over 1 GiB", "export fewer responses")
    tags = len(re.findall(rb"(?: {4}-1)(?=[\r\n]| {74}|$)", path.read_bytes()))
    if not tags:
        raise FileError(f"{path} is no UFF file: no line '    -1' begins a dataset", "give a .uff or .unv file")
    if tags % 2:
        raise FileError(f"{path} is cut: its last dataset has no end", "export it again")


def _factors(units: list[dict[str, Any]]) -> tuple[float, float]:
    """Return metres and newtons per unit of length and force in the file, by dataset 164; raises FileError."""
    if not units:
        return 1.0, 1.0
    length, force = float(units[0]["length"]), float(units[0]["force"])
    if not (0 < length < np.inf and 0 < force < np.inf):
        raise FileError(f"dataset 164 has factors {length:g} and {force:g}", "give factors above zero")
    return 1 / length, 1 / force


def _nodes(sets: list[dict[str, Any]], metre: float) -> dict[int, Point]:
    """Return positions in m by node; FileError where one is not finite or too large."""
    found = {
        int(node): (float(x) * metre, float(y) * metre, float(z) * metre)
        for one in sets
        for node, x, y, z in zip(one["node_nums"], one["x"], one["y"], one["z"], strict=True)
    }
    for node, point in found.items():
        if not all(abs(x) <= LARGEST_NUMBER for x in point):
            raise FileError(f"node {node} lies at {point[0]:g}, {point[1]:g}, {point[2]:g} m", "give coordinates in SI")
    return found


def _response(
    one: dict[str, Any], nodes: dict[int, Point], units: tuple[float, float], path: str | os.PathLike[str]
) -> Response | str:
    """Convert a dataset 58, or describe it where it is not understood; FileError where it is cut."""
    functions = {
        0: "general functions",
        2: "auto spectra",
        3: "cross spectra",
        5: "transmissibilities",
        6: "coherences",
        7: "auto correlations",
        8: "cross correlations",
        9: "power spectral densities",
        10: "energy spectral densities",
        12: "spectra",
    }
    largest_value = 1e12
    uneven = 1e-4  # of the last abscissa: text has six figures of each
    least_step = 1e-7  # Hz or s: the highest rate that a recording has
    gravity_m_s2 = 9.80665  # standard, of accelerations in g
    quantities = {8: "displacement", 11: "velocity", 12: "acceleration", 15: "pressure"}
    kind, quantity = int(one["func_type"]), quantities.get(int(one["ordinate_spec_data_type"]))
    if kind not in (1, 4):
        return functions.get(kind, f"functions of type {kind}")
    below = int(one.get("orddenom_spec_data_type", 0))
    if quantity is None or (below not in FORCE_TYPES and below != 0):
        word = "frequency responses" if kind == 4 else "time records"
        return f"{word} of ordinate type {one['ordinate_spec_data_type']} per type {below}"
    if any(abs(int(one[axis])) > 3 for axis in ("rsp_dir", "ref_dir")):
        return "rotations"
    x, value = np.asarray(one["x"], float), np.asarray(one["data"])
    count = int(one["num_pts"])
    if not len(x) == len(value) == count or count < 2:
        raise FileError(f"{path} is cut: {len(value)} of {count} values of a function", "export it again")
    if not (np.isfinite(x).all() and (np.abs(value) <= largest_value).all()):
        raise FileError(f"{path} holds values that are NaN or beyond {largest_value:g}", "export it again")
    step = float(x[-1] - x[0]) / (count - 1)
    if not least_step <= step <= LARGEST_NUMBER or np.abs(x[0] + step * np.arange(count) - x).max() > uneven * abs(
        float(x[-1])
    ):
        return "functions with uneven steps"
    metre, newton = units
    scale = newton / metre**2 if quantity == "pressure" else metre
    if str(one.get("ordinate_axis_units_lab", "")).strip().lower() in ("g", "gn", "g's"):
        scale = gravity_m_s2
    per_force = kind == 4 or below in FORCE_TYPES
    sensor, strike = (
        Freedom(int(one[f"{end}_node"]), int(one[f"{end}_dir"]), nodes.get(int(one[f"{end}_node"])))
        for end in ("rsp", "ref")
    )
    value = value * (scale / newton if per_force else scale)
    if kind == 1:
        value = np.real(value)
    return Response(quantity, kind == 4, per_force, float(x[0]), step, value, strike, sensor)


def _count_unread(unread: Counter[str]) -> list[str]:
    return [f"{words} ({count})" for words, count in unread.items()]


def _notes(found: list[Response], unread: Counter[str], kinds: list[int], assumed: int) -> list[str]:
    """List what was not understood and what was assumed, one line each."""
    quiet = (151, 2412, 82)  # header, elements, trace lines: nothing for a case
    systems = (18, 2420)
    lines = [f"not used: {', '.join(_count_unread(unread))}"] if unread else []
    others = Counter(kind for kind in kinds if kind not in (*READ_DATASETS, *quiet, *systems))
    if others:
        lines.append("not used: " + ", ".join(f"dataset {kind} ({count})" for kind, count in others.items()))
    if any(kind in systems for kind in kinds):
        lines.append("local coordinate systems are not used: directions are taken as the mesh's")
    freedoms = {f for r in found for f in (r.strike, r.sensor) if f.position_m is None and f.node}
    if freedoms:
        nodes = sorted({f.node for f in freedoms})
        listed = ", ".join(map(str, nodes[:8])) + (" …" if len(nodes) > 8 else "")
        whose = f"node {listed}" if len(nodes) == 1 else f"nodes {listed}"
        lines.append(f"no coordinates (dataset 15 or 2411) of {whose}, whose place stays null")
    if assumed:
        lines.append(f"{assumed} frequency responses do not say per what: taken per force")
    return lines
