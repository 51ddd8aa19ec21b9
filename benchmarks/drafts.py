"""Is a draft soon, and near the full sound? Scenes here, PyBullet's robots and a clutter, each rendered both ways.

    python -m benchmarks.drafts -o docs/measured/drafts.md --kept build/drafts.jsonl [NAME ...]

Each is a plain script, rendered by the command line as somebody's first scene is, in a process of its own: first with
`--draft` and an empty cache, then in full. Robots are dropped by 0.3 m on a plane. Levels are those of the whole sound
at the microphone, by octaves; one 60 dB below the loudest counts as that floor (`compare --tolerance-db` does so too).
Processor times are of the whole command. What is kept is not done again.
"""

from __future__ import annotations

import argparse
import math
import os
import resource
import subprocess
import sys
import tempfile
from pathlib import Path
from textwrap import wrap
from typing import Any

from benchmarks.kept_rows import measure_missing
from sonic_bullet.apps.compare.outcome.sound_effects import band_levels
from sonic_bullet.files import read_audio
from sonic_bullet.signal.octave_bands import AUDIBLE_OCTAVES_HZ

MOST_S, MOST_DB = 10.0, 6.0
"""What must hold: processor time of a draft, and how far an octave of it is from the full render's."""
OCTAVES_HZ = tuple(hz for hz in AUDIBLE_OCTAVES_HZ if 200 <= hz <= 8000)
FLOOR_DB = 60.0
"""Below the loudest octave of either, as of a sound's end [ISO 3382-1]."""

REPO = Path(__file__).resolve().parents[1]
SCENES = ("bar", "drop", "tabletop", "rolling", "sliding", "robot_arm")
ROBOTS = (
    "a1/a1.urdf", "aliengo/aliengo.urdf", "bicycle/bike.urdf", "biped/biped2d_pybullet.urdf",
    "differential/diff_ring.urdf", "franka_panda/panda.urdf", "gripper/wsg50_one_motor_gripper_new_free_base.sdf",
    "humanoid/humanoid.urdf", "husky/husky.urdf", "kuka_iiwa/model_free_base.urdf", "laikago/laikago_toes.urdf",
    "mini_cheetah/mini_cheetah.urdf", "pr2_gripper.urdf", "quadruped/microtaur/microtaur.urdf",
    "quadruped/minitaur.urdf", "quadruped/spirit40.urdf", "quadruped/vision60.urdf", "r2d2.urdf",
    "racecar/racecar.urdf", "xarm/xarm6_robot.urdf",
)  # fmt: skip

BEGIN = """
import random
import pybullet as p, pybullet_data
p.connect(p.DIRECT)
p.setAdditionalSearchPath(pybullet_data.getDataPath())
p.setGravity(0, 0, -9.81)
p.loadURDF("plane.urdf")
"""
DROPPED = """
load = p.loadSDF if NAME.endswith("sdf") else p.loadURDF
loaded = load(NAME)
for body in [loaded] if isinstance(loaded, int) else loaded:
    place, turn = p.getBasePositionAndOrientation(body)
    lowest = min(p.getAABB(body, link)[0][2] for link in range(-1, p.getNumJoints(body)))
    p.resetBasePositionAndOrientation(body, [place[0], place[1], place[2] + 0.3 - lowest], turn)
for _ in range(240): p.stepSimulation()
"""
CLUTTER = """
p.loadURDF("table/table.urdf", [0.5, 0, 0])
p.loadURDF("kuka_iiwa/model.urdf", [0, 0, 0.63], useFixedBase=True)
for k, n in enumerate(random.Random(68).sample(range(1000), 8)):
    p.loadURDF(f"random_urdfs/{n:03d}/{n:03d}.urdf", [0.35 + 0.15 * (k % 4), -0.15 + 0.3 * (k // 4), 0.8])
ball = p.createCollisionShape(p.GEOM_SPHERE, radius=0.008)
for k in range(18):
    p.createMultiBody(0.005, ball, -1, [0.3 + 0.05 * (k % 9), 0.05 * (k // 9), 1.0 + 0.01 * k])
for _ in range(480): p.stepSimulation()
"""
DOMINOES = """
stone = p.createCollisionShape(p.GEOM_BOX, halfExtents=[0.004, 0.012, 0.024])
stones = [p.createMultiBody(0.01, stone, -1, [0.02 * k, 0, 0.0241]) for k in range(40)]
p.resetBaseVelocity(stones[0], [0.3, 0, 0], [0, 8, 0])
for _ in range(480): p.stepSimulation()
"""


def scenes() -> dict[str, str | None]:
    """Return each scene's script by its name, None where it is a file here."""
    robots = {name: f"{BEGIN}NAME = {name!r}\n{DROPPED}" for name in ROBOTS}
    files = dict.fromkeys(f"scenes/{name}.py" for name in SCENES)
    return {**files, "dominoes": BEGIN + DOMINOES, **robots, "clutter": BEGIN + CLUTTER}


def render(script: Path, sound: Path, *, draft: bool) -> float | str:
    """Render with an empty cache; return the processor time in s, or why there is no sound."""
    with tempfile.TemporaryDirectory() as cache:
        environment = {**os.environ, "SONIC_BULLET_CACHE": cache, "SONIC_BULLET_PROGRESS": "0"}
        command = [str(Path(sys.executable).with_name("sonic-bullet")), "render", str(script), "-o", str(sound)]
        before = resource.getrusage(resource.RUSAGE_CHILDREN)
        done = subprocess.run(
            [*command, "--pascals", *(["--draft"] if draft else [])],
            capture_output=True, text=True, errors="replace", env=environment, check=False, cwd=REPO,
        )  # fmt: skip
    after = resource.getrusage(resource.RUSAGE_CHILDREN)
    if done.returncode:
        return (done.stderr.strip().splitlines() or [f"exit {done.returncode}"])[-1]
    return round(after.ru_utime + after.ru_stime - before.ru_utime - before.ru_stime, 1)


def levels_db(sound: Path) -> list[float | None]:
    """Return the levels of octaves, dB re 1 Pa², None where silent."""
    x, sr = read_audio(sound)
    levels = dict(zip(AUDIBLE_OCTAVES_HZ, band_levels(x, sr), strict=False))
    return [float(levels[hz]) if math.isfinite(levels[hz]) else None for hz in OCTAVES_HZ]


def measure(name: str, script: str | None) -> dict[str, Any]:
    """Render a scene both ways."""
    with tempfile.TemporaryDirectory() as place:
        folder = Path(place)
        if script is not None:
            (folder / "scene.py").write_text(script)
        file = REPO / name if script is None else folder / "scene.py"
        row: dict[str, Any] = {"name": name}
        for how in ("draft", "full"):
            sound = folder / f"{how}.wav"
            spent = render(file, sound, draft=how == "draft")
            if isinstance(spent, str):
                return {**row, "failed": f"{how}: {spent}"}
            row |= {f"{how}_s": spent, f"{how}_db": levels_db(sound)}
    return row


def differences_db(row: dict[str, Any]) -> list[float]:
    """Return by how much each octave of a draft is louder."""
    heights = [one for one in (*row["full_db"], *row["draft_db"]) if one is not None]
    floor = max(heights, default=0.0) - FLOOR_DB
    draft, full = ([floor if one is None else max(one, floor) for one in row[how]] for how in ("draft_db", "full_db"))
    return [a - b for a, b in zip(draft, full, strict=True)]


def page(rows: list[dict[str, Any]]) -> str:
    """Write the page."""
    done = [row for row in rows if "full_s" in row]
    most = {row["name"]: max(map(abs, differences_db(row))) for row in done}
    near, soon = sum(one <= MOST_DB for one in most.values()), sum(row["draft_s"] <= MOST_S for row in done)
    lines = [
        "# Drafts",
        "",
        "How soon is `--draft`, and how far is it from the full sound? `python -m benchmarks.drafts` renders scenes",
        "here, a row of dominoes, PyBullet's robots (dropped by 0.3 m on a plane) and a clutter (a KUKA, a table,",
        "eight meshes of random_urdfs, 18 marbles) both ways, each with an empty cache. Seconds are of processor, of",
        "the whole command. Octaves: how much louder the draft is, in dB; 60 dB below the loudest is the floor.",
        "",
        "| what | must hold | measured |",
        "|---|---|---|",
        f"| slowest draft | <= {MOST_S:.0f} s | {max((row['draft_s'] for row in done), default=0.0):.1f} s |",
        f"| drafts as soon | all | {soon} of {len(done)} |",
        f"| drafts within {MOST_DB:.0f} dB in each octave | all | {near} of {len(done)} |",
        f"| octaves within {MOST_DB:.0f} dB | all | "
        f"{sum(abs(one) <= MOST_DB for row in done for one in differences_db(row))} of {len(done) * len(OCTAVES_HZ)} |",
        "",
        f"| scene | draft, s | full, s | {' | '.join(f'{hz:.0f} Hz' for hz in OCTAVES_HZ)} |",
        f"|---|---|---|{'---|' * len(OCTAVES_HZ)}",
    ]
    for row in rows:
        if "full_s" not in row:
            lines.append(f"| {row['name']} | {row.get('draft_s', '')} | | {row['failed']} |")
            continue
        each = " | ".join(f"{one:+.1f}" for one in differences_db(row))
        lines.append(f"| {row['name']} | {row['draft_s']} | {row['full_s']} | {each} |")
    missing = [name for name in scenes() if name not in {row["name"] for row in rows}]
    if missing:
        lines += ["", *wrap(f"Not measured yet: {', '.join(missing)}.", 120, break_on_hyphens=False)]
    return "\n".join(lines) + "\n"


def main() -> None:
    """Measure what is not kept yet, and write the page."""
    parser = argparse.ArgumentParser()
    parser.add_argument("names", nargs="*")
    parser.add_argument("-o", "--output")
    parser.add_argument("--kept", help="lines of JSON, one a scene, that are not measured again")
    asked = parser.parse_args()
    known = scenes()
    kept = Path(asked.kept) if asked.kept else None
    rows = measure_missing(asked.names or known, lambda name: measure(name, known[name]), kept)
    if asked.output:
        Path(asked.output).write_text(page([rows[name] for name in known if name in rows]))


if __name__ == "__main__":
    main()
