"""Does every command run as another user, without a home, and where the install cannot be written?

    python studies/no_home.py [--commands materials,render,…] [--ways user,nameless,read-only] [--json]

user        uid 65534, HOME a folder that is not there
nameless    a uid that no passwd entry knows, no HOME, an empty environment
read-only   this user, HOME a folder that takes nothing

In all three the package is mounted read-only, in a mount namespace of its own (unshare, as root), and where this user's
own home hides the interpreter it is opened. Outputs go to a folder that may be written. Good: exit 0, what was asked
for is there, and nothing on stderr but notes and progress. Where nothing can be mounted, "read-only" runs without a
mount and the rest is counted as skipped. Exit 1 where one is not good.
"""

from __future__ import annotations

import argparse
import importlib
import json
import os
import re
import subprocess
import sys
import tempfile
import time
from pathlib import Path

PROGRESS = re.compile(r"\[\d+ s\] ")
REPO = Path(__file__).resolve().parents[1]
WAYS = ("user", "nameless", "read-only")
UIDS = {"user": 65534, "nameless": 54321}
COMMANDS: dict[str, tuple[tuple[str, ...], tuple[str, ...]]] = {
    "help": (("--help",), ()),
    "materials": (("materials", "--json", "m.json"), ("m.json",)),
    "modes": (("modes", "box.obj", "--count", "3", "-o", "m.npz"), ("m.npz",)),
    "doctor": (("doctor", "scene.py", "--seconds", "0.05"), ()),
    "render": (
        ("render", "scene.py", "-o", "a.flac", "--contacts", "a.npz", "--picture", "a.png"),
        ("a.flac", "a.npz", "a.png"),
    ),
    "replay": (("render", "a.npz", "-o", "b.ogg"), ("b.ogg",)),
    "features": (("features", "s0.wav", "--picture", "f.png"), ("f.png",)),
    "fit": (("fit", ".", "-o", "p.json", "--picture", "p.png"), ("p.json", "p.png")),
    "residual": (("residual", "s0.wav", "--material", "steel", "-o", "r.json"), ("r.json",)),
    "diagnose": (
        ("diagnose", ".", "-o", "d.json", "--predict", "predicted", "--report", "page.html"),
        ("d.json", "predicted/after", "page.html"),
    ),
}
SCENE = """
SECONDS = 0.1
def build(client):
    client.setGravity(0, 0, -9.81)
    client.createMultiBody(0, client.createCollisionShape(client.GEOM_PLANE))
    bar = client.createMultiBody(0.5, client.createCollisionShape(client.GEOM_BOX, halfExtents=[0.1, 0.01, 0.01]), \
basePosition=[0, 0, 0.011])
    return {bar: {"material": "steel", "count": 5}}
"""
# $1 another place for the interpreter, $2 the folder that hides it ("" where none does), $3 the interpreter's, $4 the
# repository
INSIDE = """set -e
if [ -n "$2" ]; then
    mount --bind "$3" "$1"; mount -t tmpfs -o mode=755 none "$2"; mkdir -p "$3"; mount --bind "$1" "$3"
fi
mount --bind "$4" "$4"; mount -o remount,ro,bind "$4"
shift 4
exec "$@"
"""


def command(direction: str, scratch: Path, words: list[str]) -> list[str] | None:
    """``words`` run in that way, from ``scratch``, a folder of nobody's; None where this user cannot."""
    home = {"user": ["HOME=/no/such/home"], "nameless": [], "read-only": [f"HOME={scratch / 'sealed'}"]}[direction]
    plain = ["env", "-i", "PATH=/usr/bin:/bin", "OMP_NUM_THREADS=1", "OPENBLAS_NUM_THREADS=1", *home, *words]
    if direction in UIDS:
        plain = ["setpriv", f"--reuid={UIDS[direction]}", f"--regid={UIDS[direction]}", "--clear-groups", *plain]
    if os.geteuid() != 0:
        return plain if direction == "read-only" else None
    base = Path(sys.base_prefix)
    hidden = [place for place in reversed(base.parents) if not place.stat().st_mode & 0o001]
    inside = [
        "unshare",
        "-m",
        "sh",
        "-c",
        INSIDE,
        "sh",
        str(scratch / "interpreter"),
        str(hidden[0]) if hidden else "",
        str(base),
        str(REPO),
    ]
    if direction == "read-only":  # root writes wherever it likes: to a home that is mounted read-only it does not
        seal = 'mount -t tmpfs -o ro,mode=755 none "$0" && exec "$@"'
        plain = ["sh", "-c", seal, str(scratch / "sealed"), *plain]
    return [*inside, *plain]


def prepared(scratch: Path) -> Path:
    """A folder that everybody may write to, with a scene, a mesh, and a case in it."""
    sys.path.insert(0, str(REPO))
    from sonic_bullet.records import Material

    work = scratch / "work"
    for place in (work, scratch / "interpreter", scratch / "sealed"):
        place.mkdir()
    scratch.chmod(0o755)
    (scratch / "sealed").chmod(0o555)
    (work / "scene.py").write_text(SCENE)
    material = Material.isotropic(
        "planted", youngs_pa=7e10, poisson=0.33, density_kg_m3=2700, alpha_per_s=5.0, beta_s=1e-7
    )
    importlib.import_module("tests.made.case").make(work, material, guess=(6.5e10, 2700, 0.3), strikes=3, seconds=0.4)
    for path in (work, *work.iterdir()):
        path.chmod(0o777)
    return work


def good(direction: str, name: str, scratch: Path, work: Path) -> tuple[bool | None, str]:
    """Whether a command runs in that way (None: it cannot be tried here), and what it said."""
    words, made = COMMANDS[name]
    asked = command(
        direction, scratch, [sys.executable, "-c", "from sonic_bullet.apps.cli import main; main()", *words]
    )
    if asked is None:
        return None, "skipped"
    start = time.monotonic()
    done = subprocess.run(asked, cwd=work, check=False, capture_output=True, text=True, timeout=3000)
    lines = [
        line
        for line in done.stderr.splitlines()
        if not line.startswith(("sonic-bullet: note:", "pybullet build time")) and not PROGRESS.match(line)
    ]
    if name in ("fit", "residual", "diagnose"):
        lines = [line for line in lines if not line.startswith("sonic-bullet: warning:")]
    lines += [line for line in done.stderr.splitlines() if "are not kept" in line][1:]  # said once at most
    there = [file for file in made if (work / file).exists()]
    said = (
        f"exit {done.returncode}, {len(there)} of {len(made)} outputs, {time.monotonic() - start:.0f} s "
        f"{' | '.join(lines)[-300:]}"
    )
    return done.returncode == 0 and len(there) == len(made) and not lines, said


def main() -> None:
    """A line a way and command."""
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("--commands", default=",".join(COMMANDS))
    parser.add_argument("--ways", default=",".join(WAYS))
    parser.add_argument("--json", action="store_true")
    asked = parser.parse_args()
    counts = {"good": 0, "bad": 0, "skipped": 0}
    for direction in asked.ways.split(","):
        with tempfile.TemporaryDirectory(prefix="no-home-") as place:
            work = prepared(Path(place))
            for name in asked.commands.split(","):
                found, said = good(direction, name, Path(place), work)
                counts["skipped" if found is None else "good" if found else "bad"] += 1
                if not asked.json or found is False:
                    print(f"{direction:10} {name:10} {said}", file=sys.stderr if asked.json else sys.stdout, flush=True)
    print(json.dumps(counts) if asked.json else ", ".join(f"{n} {what}" for what, n in counts.items()))
    sys.exit(counts["bad"] > 0)


if __name__ == "__main__":
    main()
