"""Do all meshes of pybullet_data have modes, or one named error each, within 60 s and 2 GB?

    python studies/modal_sweep.py [--sample N] [--workers W] [--rows OUT.jsonl]

Each mesh is analysed in a process of its own, without the cache; prints a row each that is slow or fails, then the
counts, and exits 1 where a mesh hung, grew or failed without a name. --rows keeps a line of JSON a mesh as it is done,
and skips those that the file has.
"""

from __future__ import annotations

import argparse
import json
import re
import resource
import subprocess
import sys
import time
from concurrent.futures import ThreadPoolExecutor
from pathlib import Path

LIMIT_S, LIMIT_BYTES = 60.0, 2 * 1024**3


def meshes(sample: int | None) -> list[tuple[str, float]]:
    """(file, scale) of every body: the thousand random ones with their URDF's scale, then mug, bunny, duck."""
    import pybullet_data

    root = Path(pybullet_data.getDataPath())
    found = []
    for urdf in sorted((root / "random_urdfs").glob("*/*.urdf")):
        scale = re.search(r'scale="([-\d.e]+)', urdf.read_text())
        found.append((str(urdf.with_suffix(".obj")), float(scale.group(1)) if scale else 1.0))
    if sample is not None:
        found = found[:: max(1, len(found) // sample)][:sample]
    return [*found, (str(root / "objects/mug.obj"), 1.0), (str(root / "bunny.obj"), 0.1), (str(root / "duck.obj"), 0.1)]


def one(path: str, scale: float) -> None:
    """Child: analyse one mesh and print what came of it as JSON."""
    from sonic_bullet.modal import analyse, read_mesh
    from sonic_bullet.records import Material
    from sonic_bullet.records.errors import SonicBulletError

    plastic = Material.isotropic(
        "plastic", youngs_pa=2.4e9, poisson=0.37, density_kg_m3=1050.0, alpha_per_s=30.0, beta_s=1e-6
    )
    start = time.monotonic()
    try:
        model = analyse((read_mesh(path, scale),), plastic, cache=None)
        said = {
            "modes": model.mode_count,
            "first_hz": float(model.freq_hz[0]) if model.mode_count else None,
            "note": model.note,
        }
    except SonicBulletError as error:
        said = {"error": f"{type(error).__name__}: {error}"}
    usage = [resource.getrusage(who) for who in (resource.RUSAGE_SELF, resource.RUSAGE_CHILDREN)]
    peak = max(u.ru_maxrss for u in usage) * 1024
    processor_s = sum(u.ru_utime + u.ru_stime for u in usage)
    print(json.dumps({**said, "seconds": time.monotonic() - start, "processor_s": processor_s, "peak_bytes": peak}))


def run(job: tuple[str, float]) -> dict[str, object]:
    """Parent: the child's answer, or why there is none."""
    command = [sys.executable, __file__, "--one", job[0], "--scale", str(job[1])]
    try:
        ended = subprocess.run(command, capture_output=True, text=True, timeout=3 * LIMIT_S, check=False)
        answer: dict[str, object] = (
            json.loads(ended.stdout.splitlines()[-1]) if ended.returncode == 0 else {"crash": ended.stderr[-300:]}
        )
    except subprocess.TimeoutExpired:
        answer = {"crash": "hung"}
    return {"mesh": _label(job[0]), **answer}


def _label(path: str) -> str:
    return "/".join(Path(path).parts[-2:])


def main() -> int:
    parser = argparse.ArgumentParser()
    parser.add_argument("--sample", type=int)
    parser.add_argument("--workers", type=int, default=2)
    parser.add_argument("--rows", type=Path)
    parser.add_argument("--one")
    parser.add_argument("--scale", type=float, default=1.0)
    given = parser.parse_args()
    if given.one:
        one(given.one, given.scale)
        return 0
    rows = (
        [json.loads(line) for line in given.rows.read_text().splitlines()] if given.rows and given.rows.exists() else []
    )
    known = {row["mesh"] for row in rows}
    with ThreadPoolExecutor(given.workers) as pool:
        for row in pool.map(run, [job for job in meshes(given.sample) if _label(job[0]) not in known]):
            rows.append(row)
            if given.rows:
                with given.rows.open("a") as file:
                    file.write(json.dumps(row) + "\n")
            if "modes" not in row or float(str(row["seconds"])) > LIMIT_S / 2:
                print(row, flush=True)
    done = [r for r in rows if "modes" in r]
    named = [r for r in rows if "error" in r]
    slow = [r for r in rows if float(str(r.get("seconds", 0))) > LIMIT_S]
    big = [r for r in rows if int(str(r.get("peak_bytes", 0))) > LIMIT_BYTES]
    crashed = [r for r in rows if "crash" in r]
    seconds = sorted(float(str(r["seconds"])) for r in rows if "seconds" in r)
    peak = max(int(str(r.get("peak_bytes", 0))) for r in rows)
    print(
        f"{len(rows)} meshes: {len(done)} with a model, {len(named)} named errors, {len(crashed)} crashes, "
        f"{len(slow)} over {LIMIT_S:g} s, {len(big)} over 2 GiB"
    )
    processor = sorted(float(str(r["processor_s"])) for r in rows if "processor_s" in r)
    for what, figures in (("seconds", seconds), ("processor seconds", processor)):
        print(f"{what}: median {figures[len(figures) // 2]:.1f}, longest {figures[-1]:.1f}")
    print(f"peak {peak / 1024**2:.0f} MiB")
    return 1 if slow or big or crashed else 0


if __name__ == "__main__":
    sys.exit(main())
