"""CalculiX asked for the modes of a free body of 20-node bricks [Dhondt, CalculiX CrunchiX manual 2.20, ch. 6.9.3].

    Bricks -> .inp (*FREQUENCY, elements C3D20R) -> ccx, one thread -> eigenvalues in .dat -> elastic modes, ascending

C3D20R integrates stiffness and mass at 2³ points. C3D20 with 3³ is stiffer in thin walls: of a plate of h/a 0.01 in
12² cells mode 15 is 2.7 % above C3D20R's in 20², with C3D20R 0.2 %.
"""

from __future__ import annotations

import os
import re
import shutil
import subprocess
import tempfile
import time
from dataclasses import dataclass
from pathlib import Path

import numpy as np

from benchmarks.suite.bricks import OFFSET, Bricks
from sonic_bullet.records import Array

PACKAGE = "calculix-ccx"
LIMIT_S = 900.0  # wall time of one run on a busy machine
RIGID_SHARE = 0.05  # of the first elastic frequency: what a rigid mode may come out at

# corners below, above, then edges below, above, upright, each counter-clockwise
_CCX = [
    (0, 0, 0), (2, 0, 0), (2, 2, 0), (0, 2, 0), (0, 0, 2), (2, 0, 2), (2, 2, 2), (0, 2, 2),
    (1, 0, 0), (2, 1, 0), (1, 2, 0), (0, 1, 0), (1, 0, 2), (2, 1, 2), (1, 2, 2), (0, 1, 2),
    (0, 0, 1), (2, 0, 1), (2, 2, 1), (0, 2, 1),
]  # fmt: skip
ORDER = [OFFSET.tolist().index(list(at)) for at in _CCX]


class CcxError(RuntimeError):
    """CalculiX gave no modes, or not those of a free body."""


@dataclass(frozen=True, slots=True, eq=False)
class Run:
    """frequency_hz (m,) of the elastic modes, ascending; unknowns; processor time and largest memory of the process."""

    frequency_hz: Array
    unknowns: int
    processor_s: float
    peak_bytes: int


def installed() -> str | None:
    """Path of ccx, None where it is not installed."""
    return shutil.which("ccx")


def version() -> str:
    """What `ccx -v` says, such as "2.20"."""
    said = subprocess.run(["ccx", "-v"], capture_output=True, text=True, check=False).stdout
    return said.split()[-1]


def job(
    node_m: Array, cell: Array, youngs_pa: float, poisson: float, density_kg_m3: float, count: int, element: str
) -> str:
    """Text of a .inp file: the lowest ``count`` modes of a free body of cells (c, k) in ccx's order of their nodes, in
    SI units; ccx reads twenty characters a number, and ten nodes a line.
    """
    node = "\n".join(f"{i},{x:.12e},{y:.12e},{z:.12e}" for i, (x, y, z) in enumerate(node_m.tolist(), 1))
    rows = ([i, *row] for i, row in enumerate((cell + 1).tolist(), 1))
    elements = "\n".join(
        ",\n".join(",".join(map(str, row[k : k + 11])) for k in range(0, len(row), 11)) for row in rows
    )
    return (
        f"*NODE,NSET=ALL\n{node}\n*ELEMENT,TYPE={element},ELSET=BODY\n{elements}\n"
        f"*MATERIAL,NAME=M\n*ELASTIC\n{youngs_pa!r},{poisson!r}\n*DENSITY\n{density_kg_m3!r}\n"
        f"*SOLID SECTION,ELSET=BODY,MATERIAL=M\n*STEP\n*FREQUENCY\n{count}\n*END STEP\n"
    )


def modes(
    body: Bricks, youngs_pa: float, poisson: float, density_kg_m3: float, *, count: int = 15, element: str = "C3D20R"
) -> Run:
    """The lowest ``count`` elastic modes of bricks by CalculiX, one thread. Raises CcxError."""
    return solve(body.node_m, body.cell[:, ORDER], youngs_pa, poisson, density_kg_m3, count=count, element=element)


def solve(
    node_m: Array,
    cell: Array,
    youngs_pa: float,
    poisson: float,
    density_kg_m3: float,
    *,
    count: int = 15,
    element: str = "C3D10",
) -> Run:
    """The lowest ``count`` elastic modes of cells (c, k) in ccx's order by CalculiX, one thread. Raises CcxError."""
    with tempfile.TemporaryDirectory() as folder:
        (Path(folder) / "job.inp").write_text(job(node_m, cell, youngs_pa, poisson, density_kg_m3, count + 6, element))
        one = dict.fromkeys(("OMP_NUM_THREADS", "CCX_NPROC_EQUATION_SOLVER"), "1")
        with (Path(folder) / "said").open("w") as said:
            child = subprocess.Popen(
                ["ccx", "-i", "job"], cwd=folder, env={**os.environ, **one}, stdout=said, stderr=subprocess.STDOUT
            )
            end, peak = time.monotonic() + LIMIT_S, 0
            while (ended := os.wait4(child.pid, os.WNOHANG))[0] == 0:
                if time.monotonic() > end:
                    child.kill()
                    raise CcxError(f"ccx took more than {LIMIT_S:g} s")
                peak = max(peak, _peak_bytes(child.pid))
                time.sleep(0.02)
        usage = ended[2]
        dat = Path(folder) / "job.dat"
        text = dat.read_text() if dat.exists() else ""
        if "E I G E N V A L U E" not in text:
            raise CcxError((Path(folder) / "said").read_text()[-600:])
    frequency = frequencies_hz(text)
    rigid, elastic = frequency[:6], frequency[6:]
    if len(elastic) < count or not rigid.max() < RIGID_SHARE * elastic[0]:
        raise CcxError(f"not six rigid modes and {count} others: {frequency[:8]} Hz")
    return Run(elastic, 3 * len(node_m), usage.ru_utime + usage.ru_stime, peak)


def _peak_bytes(process: int) -> int:
    """Largest memory of a running process; its rusage would count what Python held before ccx took its place."""
    try:
        found = re.search(r"VmHWM:\s+(\d+) kB", Path(f"/proc/{process}/status").read_text())
    except OSError:
        return 0
    return int(found[1]) * 1024 if found else 0


def frequencies_hz(dat: str) -> Array:
    """Frequencies in the eigenvalue table of a .dat file, ascending; 0 where rounding made a rigid mode's value
    negative.
    """
    table = dat.partition("E I G E N V A L U E")[2].partition("P A R T I C I P A T I O N")[0]
    row = re.findall(r"^ +\d+ +(\S+) +(\S+) +(\S+) +(\S+) *$", table, re.M)
    value = np.array([float(columns[0]) for columns in row])
    return np.asarray(np.sqrt(np.sort(value).clip(min=0)) / (2 * np.pi))
