"""Do modes, a log's replay and scenes agree between two Pythons?

    python studies/python_versions.py .venv/bin/python OTHER/bin/python [--scenes bar drop …]

Both interpreters must have the package's dependencies; both run this checkout by the command line. Rows:

modes      of each mesh in assets/, largest relative difference of frequency and of decay
replay     one log, made by the first, rendered by both: largest difference of samples, dB of the peak
bar        run by both: the same
scene      run by both: relative difference of the sum of all impulses' sizes

What must hold: -120 dB for modes, replay and bar; 1 % for scenes. Exit 1 where it does not.
"""

from __future__ import annotations

import argparse
import json
import os
import subprocess
import sys
import tempfile
from pathlib import Path

import numpy as np

ROOT = Path(__file__).parents[1]
ALIKE_DB, ALIKE_SHARE = -120.0, 0.01
IMPULSES = (
    "import sys, numpy, sonic_bullet as sb;"
    "print(numpy.linalg.norm(sb.read_log(sys.argv[1]).rows.impulse_n_s, axis=1).sum())"
)


def run(python: str, *arguments: str) -> str:
    """What a Python prints when it runs with this checkout on its path. Raises CalledProcessError."""
    asked = {**os.environ, "PYTHONPATH": str(ROOT), "OMP_NUM_THREADS": "1", "OPENBLAS_NUM_THREADS": "1"}
    return subprocess.run(
        [python, *arguments], cwd=ROOT, env=asked, check=True, stdout=subprocess.PIPE, text=True
    ).stdout


def command(python: str, *arguments: str) -> str:
    """What the `sonic-bullet` command prints."""
    return run(python, "-m", "sonic_bullet", *arguments)


def difference_db(a: Path, b: Path) -> float:
    """Largest difference of two sounds, in dB of the first one's peak; infinite where their lengths differ."""
    from sonic_bullet.files import read_audio

    x, y = read_audio(a)[0], read_audio(b)[0]
    if x.shape != y.shape:
        return float("inf")
    return float(20 * np.log10(max(np.abs(x - y).max() / np.abs(x).max(), 1e-15)))


def modes_row(first: str, other: str, mesh: Path) -> tuple[str, float, bool]:
    """Largest relative difference of a mesh's frequencies and decays, in dB."""
    both = [json.loads(command(p, "modes", str(mesh), "--material", "steel", "--json")) for p in (first, other)]
    worst = 0.0
    for name in ("freq_hz", "decay_per_s"):
        x, y = (np.array([mode[name] for mode in found["modes"]]) for found in both)
        worst = max(worst, float(np.abs(y / x - 1).max()) if x.shape == y.shape else np.inf)
    db = float(20 * np.log10(max(worst, 1e-15)))
    return f"modes of {mesh.name}", db, db <= ALIKE_DB


def scene_rows(first: str, other: str, scene: str, folder: Path) -> list[tuple[str, float, bool]]:
    """A scene run by both; of the first one's log the replay by both, where the scene is `bar`."""
    sound, log = ([folder / f"{scene}{i}{end}" for i in (0, 1)] for end in (".wav", ".npz"))
    for python, wav, npz in zip((first, other), sound, log, strict=True):
        command(python, "render", f"scenes/{scene}.py", "-o", str(wav), "--contacts", str(npz), "--pascals")
    total = [float(run(first, "-c", IMPULSES, str(npz))) for npz in log]
    share = abs(total[1] / total[0] - 1)
    rows = [(f"{scene}: impulses, share", share, share <= ALIKE_SHARE)]
    if scene == "bar":
        again = [folder / f"replay{i}.wav" for i in (0, 1)]
        for python, wav in zip((first, other), again, strict=True):
            command(python, "render", str(log[0]), "-o", str(wav), "--pascals")
        for name, pair in (("bar: samples, dB", sound), ("bar's log replayed: samples, dB", again)):
            db = difference_db(*pair)
            rows.append((name, db, db <= ALIKE_DB))
    return rows


def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0] if __doc__ else "")
    parser.add_argument("first")
    parser.add_argument("other")
    parser.add_argument("--scenes", nargs="*", default=sorted(p.stem for p in (ROOT / "scenes").glob("*.py")))
    asked = parser.parse_args()
    kept = True
    with tempfile.TemporaryDirectory() as folder:
        print("| what | difference | holds |\n|---|---|---|")
        for mesh in sorted((ROOT / "assets").glob("*.obj")):
            name, value, good = modes_row(asked.first, asked.other, mesh)
            print(f"| {name}, dB | {value:.0f} | {'yes' if good else 'NO'} |", flush=True)
            kept &= good
        for scene in asked.scenes:
            for name, value, good in scene_rows(asked.first, asked.other, scene, Path(folder)):
                print(f"| {name} | {value:.3g} | {'yes' if good else 'NO'} |", flush=True)
                kept &= good
    sys.exit(0 if kept else 1)


if __name__ == "__main__":
    main()
