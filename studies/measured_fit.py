"""What a fit says of measured objects whose shape is known.

The data stay where they are; a case of each is written to a temporary folder.

    python studies/measured_fit.py --data ../shared/measured [SET ...]

    pyrfda-steel-bar
        one tap of a bar of measured size and mass; place of tap and microphone unknown; 0.5-10 kHz (above, the
                          decimated file's filter rings)
    pyrfda-main-lines     the six lines of that take that its README calls the main ones
    rus-crystals
        50 resonances of a strontium titanate block of measured size and density, read as an isotropic body's
    spruce-plates
        six spruce plates with measured size, mass, frequencies and damping: all together without a shape (what the
        decays say),
                          and the first with its shape, read as an isotropic body
    flax-laminate         two frequencies of a square plate
    glockenspiel-fluidr3
        bars whose size nobody wrote down: decays of all four together, without a shape. From pitch, E/ρ and the length
        only come
                          together (f ∝ √(E/ρ)/L²), so no size is made up

A row: lines heard, modes paired, E/ρ and ν, α and β with their spreads, and the verdict. Sizes and masses as their
READMEs give them.
"""

from __future__ import annotations

import argparse
import json
import shutil
import sys
import tempfile
import time
from collections.abc import Callable
from pathlib import Path
from typing import Any

import numpy as np

from sonic_bullet.files.cases import read_case
from sonic_bullet.lab.fit.material_fit import CaseFit, fit_case
from sonic_bullet.records.errors import SonicBulletError

BOX = [[x, y, z] for x in (-0.5, 0.5) for y in (-0.5, 0.5) for z in (-0.5, 0.5)]
FACES = [
    [1, 2, 4],
    [1, 4, 3],
    [5, 7, 8],
    [5, 8, 6],
    [1, 5, 6],
    [1, 6, 2],
    [3, 4, 8],
    [3, 8, 7],
    [1, 3, 7],
    [1, 7, 5],
    [2, 6, 8],
    [2, 8, 4],
]
# relative: of a damping ratio read off a response, of a resonance of the crystal (the sets give none)
SPREAD = {"zeta": 0.1, "rus": 2e-4}


def _box(folder: Path, size_m: tuple[float, float, float]) -> str:
    rows = [f"v {x * size_m[0]:.9g} {y * size_m[1]:.9g} {z * size_m[2]:.9g}" for x, y, z in BOX] + [
        f"f {a} {b} {c}" for a, b, c in FACES
    ]
    (folder / "box.obj").write_text("\n".join(rows) + "\n")
    return "box.obj"


def _write(folder: Path, name: str, objects: dict[str, Any], recordings: list[dict[str, Any]], **more: Any) -> None:
    case = {"format": "sonic-bullet-case/1", "case": name, "objects": objects, "recordings": recordings, **more}
    (folder / "case.json").write_text(json.dumps(case))


def _guess(name: str, youngs_pa: float, density: float, poisson: float) -> dict[str, Any]:
    return {
        "material": name,
        "elastic_guess": {"youngs_modulus": youngs_pa, "density": density, "poisson_ratio": poisson},
    }


def steel_bar(data: Path, folder: Path) -> None:
    told = json.loads((data / "pyrfda-steel-bar" / "case.json").read_text())
    file = told["files"][0]["file"]
    shutil.copy(data / "pyrfda-steel-bar" / file, folder / "bar.flac")
    shutil.copy(data / "pyrfda-steel-bar" / "mesh" / "bar.obj", folder / "bar.obj")
    density = told["mass_kg"] / float(np.prod(list(told["dimensions_m"].values())))
    bar = {"mesh": "bar.obj", "units": "m"} | _guess("steel", 2e11, density, 0.29)
    _write(
        folder,
        "pyrfda-steel-bar",
        {"bar": bar},
        [{"file": "bar.flac", "object": "bar"}],
        sensor={"type": "microphone"},
        band_hz=[500, 10000],
        onset=0.0,
    )


def steel_bar_lines(data: Path, folder: Path) -> None:
    """The six lines that the set's own reader calls the main ones, decays where it gives them: for a bar of unknown
    strike, fewer lines say more.
    """
    told = json.loads((data / "pyrfda-steel-bar" / "case.json").read_text())
    shutil.copy(data / "pyrfda-steel-bar" / "mesh" / "bar.obj", folder / "bar.obj")
    density = told["mass_kg"] / float(np.prod(list(told["dimensions_m"].values())))
    lines = [
        {"freq_hz": m["f_hz"]} | ({"decay_per_s": 6.908 / m["t60_s"]} if isinstance(m["t60_s"], float) else {})
        for m in told["files"][0]["main_lines"]
    ]
    bar = {"mesh": "bar.obj", "units": "m"} | _guess("steel", 2e11, density, 0.29)
    _write(
        folder,
        "pyrfda-steel-bar, its main lines",
        {"bar": bar},
        [{"features": lines, "object": "bar"}],
        band_hz=[200, 12000],
    )


def crystal(data: Path, folder: Path) -> None:
    told = json.loads((data / "rus-crystals" / "case.json").read_text())["cases"][0]
    shutil.copy(data / "rus-crystals" / told["mesh"], folder / "block.obj")
    lines = [
        {"freq_hz": f, "freq_sd_hz": SPREAD["rus"] * f} for f, w in zip(told["f_hz"], told["weight"], strict=True) if w
    ]
    block = {"mesh": "block.obj", "units": "m"} | _guess("titanate", 2.7e11, told["density_kg_m3"], 0.24)
    _write(
        folder, "rus-crystals srtio3", {"block": block}, [{"features": lines, "object": "block"}], band_hz=[1e5, 3e6]
    )


def _plates(data: Path) -> list[dict[str, Any]]:
    found: list[dict[str, Any]] = json.loads((data / "tables-derived" / "dev" / "spruce_plates_1-3.json").read_text())[
        "plates"
    ]
    return found


def _damped(modes: list[dict[str, Any]]) -> list[dict[str, Any]]:
    """Features of damping ratios: d = ζ ω."""
    decays = [2 * np.pi * m["f_hz"] * m["zeta"] for m in modes]
    return [
        {"freq_hz": m["f_hz"], "decay_per_s": d, "decay_sd_per_s": SPREAD["zeta"] * d, "freq_sd_hz": 0.5}
        for m, d in zip(modes, decays, strict=True)
    ]


def spruce(data: Path, folder: Path) -> None:
    objects = {p["plate"]: _guess("wood", 1.1e10, p["density_kg_m3"], 0.37) for p in _plates(data)}
    _write(
        folder,
        "spruce plates, no shape",
        objects,
        [{"features": _damped(p["modes"]), "object": p["plate"]} for p in _plates(data)],
        band_hz=[20, 2000],
    )


def spruce_shaped(data: Path, folder: Path) -> None:
    plate = _plates(data)[0]
    size = (plate["length_mm"] / 1e3, plate["width_mm"] / 1e3, plate["thickness_mm"] / 1e3)
    objects = {"plate": {"mesh": _box(folder, size)} | _guess("wood", 5e9, plate["density_kg_m3"], 0.37)}
    _write(
        folder,
        "spruce plate 1L as isotropic",
        objects,
        [{"features": _damped(plate["modes"]), "object": "plate"}],
        band_hz=[20, 800],
    )


def laminate(data: Path, folder: Path) -> None:
    tables = json.loads((data / "tables-derived" / "dev" / "published.json").read_text())["tables"]
    told = next(t for t in tables if t["id"] == "flax_laminate")
    objects = {
        "plate": {"mesh": _box(folder, tuple(told["dimensions_m"]))}
        | _guess("plastic", 1e10, told["density_kg_m3"], 0.3)
    }
    _write(
        folder,
        "flax laminate",
        objects,
        [{"features": [{"freq_hz": f} for f in told["f_hz"]], "object": "plate"}],
        band_hz=[20, 1000],
    )


def glockenspiel(data: Path, folder: Path) -> None:
    told = json.loads((data / "glockenspiel-fluidr3" / "case.json").read_text())
    recordings = []
    for entry in told["files"]:
        name = Path(entry["file"]).name
        shutil.copy(data / "glockenspiel-fluidr3" / entry["file"], folder / name)
        recordings.append({"file": name, "object": entry["bar"]})
    _write(folder, "glockenspiel, no shape", {r["object"]: {"material": "steel"} for r in recordings}, recordings)


SETS: dict[str, Callable[[Path, Path], None]] = {
    "pyrfda-steel-bar": steel_bar,
    "pyrfda-main-lines": steel_bar_lines,
    "rus-crystals": crystal,
    "spruce-plates": spruce,
    "spruce-plate-shaped": spruce_shaped,
    "flax-laminate": laminate,
    "glockenspiel-fluidr3": glockenspiel,
}


def fitted(data: Path, name: str) -> CaseFit:
    """The fit of one set.

    Raises SonicBulletError, KeyError for an unknown set, OSError where the data are not there.
    """
    with tempfile.TemporaryDirectory() as place:
        SETS[name](data, Path(place))
        return fit_case(read_case(place))


def _shown(value: float, spread: float) -> str:
    return f"{value:.4g} ± {100 * spread:.2g} %" if np.isfinite(spread) else "not told"


def main() -> int:
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0] if __doc__ else "")
    parser.add_argument("--data", type=Path, required=True)
    parser.add_argument("sets", nargs="*", metavar="SET")
    asked = parser.parse_args()
    failed = 0
    print("set | lines | paired | E/ρ in m²/s² | ν | α in 1/s | β in s | scatter f, d | s | verdict")
    for name in asked.sets or SETS:
        begun = time.process_time()
        try:
            found = fitted(asked.data, name)
        except (SonicBulletError, OSError) as error:
            failed += 1
            print(f"{name} | {error}")
            continue
        fit, sd = found.fit, np.sqrt(np.diag(found.fit.covariance))
        listed = sum(len(r.lines or ()) for r in found.case.recordings)
        lines = listed or sum(len(o.evidence.lines.freq_hz) for o in found.objects) or "heard"
        paired = sum(int((o.line >= 0).sum()) for o in found.objects)
        nu = f"{fit.poisson_ratio:.3f} ± {sd[4]:.2g}" if np.isfinite(sd[4]) else "not told"
        row = (_shown(fit.gamma_m2_s2, sd[2]), nu, _shown(fit.alpha_per_s, sd[0]), _shown(fit.beta_s, sd[1]))
        print(
            name,
            lines,
            paired,
            *row,
            f"{found.frequency_scatter:.2%}, {found.damping_scatter:.0%}",
            f"{time.process_time() - begun:.0f}",
            sep=" | ",
            end=" | ",
        )
        print("; ".join([fit.verdict, *(f"warning: {w}" for w in found.warnings)]), flush=True)
    return 1 if failed else 0


if __name__ == "__main__":
    sys.exit(main())
