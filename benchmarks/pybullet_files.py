"""Does whatever comes with PyBullet sound, and how soon? Every URDF, SDF and MJCF file of pybullet_data, dropped.

    python -m benchmarks.pybullet_files -o docs/measured/pybullet-data.md --kept build/pybullet-data.jsonl [NAME ...]

A file a process, with an empty cache of its own. It is dropped by 0.3 m on a plane, of steel, and heard for a second.
On what cannot move, a steel ball is dropped. The processor time to its sound counts the start of Python, the fall and
the modes of what was touched. Then every link that collides, touched or not, is solved as a draft: does it have modes,
or why not? What is kept is not done again. `--blobs 60` takes so many of the 1,000 random_urdfs, drawn by `--seed`.
"""

from __future__ import annotations

import argparse
import json
import os
import random
import resource
import signal
import subprocess
import sys
import tempfile
import warnings
from collections import Counter
from datetime import date
from functools import partial
from pathlib import Path
from textwrap import wrap
from typing import Any

from benchmarks.kept_rows import measure_missing

HEIGHT_M, STEPS = 0.3, 240
MOST_S, MEDIAN_S, LEAST_SOUNDING = 60.0, 8.0, 0.95
"""What must hold: processor time of one file and their median, and the fraction of links that sound or are planes."""


def all_files() -> list[str]:
    """List every file that PyBullet might load, by its path in pybullet_data."""
    import pybullet_data

    root = Path(pybullet_data.getDataPath())
    return sorted(str(one.relative_to(root)) for kind in ("urdf", "sdf", "xml") for one in root.rglob(f"*.{kind}"))


def drawn_files(blobs: int, seed: int) -> list[str]:
    """List every file that is no blob of random_urdfs, and so many of those, drawn by a seed: no cheap ones chosen."""
    files = all_files()
    alike = [name for name in files if name.startswith("random_urdfs/")]
    return [name for name in files if name not in alike] + random.Random(seed).sample(alike, min(blobs, len(alike)))


def drop(name: str) -> dict[str, Any]:
    """Drop a file and describe its sound; exit code 3 where PyBullet cannot load it."""
    import numpy as np
    import pybullet
    import pybullet_data
    from pybullet_utils.bullet_client import BulletClient

    import sonic_bullet
    from sonic_bullet.session.arguments import as_material
    from sonic_bullet.session.links_of_script import add_links
    from sonic_bullet.simulators import body_ids, is_static, links_with_shapes

    client = BulletClient(pybullet.DIRECT)
    listener = sonic_bullet.attach(client, microphone=(0.0, -1.0, 0.5))  # as `render` does: before a script loads
    client.setAdditionalSearchPath(pybullet_data.getDataPath())
    client.setGravity(0, 0, -9.81)
    load = client.loadMJCF if name.endswith("xml") else client.loadSDF if name.endswith("sdf") else client.loadURDF
    try:
        load(name)
    except pybullet.error:
        sys.exit(3)
    static = partial(is_static, client._client)
    links = [link for body in body_ids(client._client) for link in links_with_shapes(client._client, body)]
    movable = {body for body, link in links if not static(body, link)}
    lowest = min((client.getAABB(*link)[0][2] for link in links if link[0] in movable), default=0.0)
    for body in movable:
        place, turn = client.getBasePositionAndOrientation(body)
        client.resetBasePositionAndOrientation(body, np.add(place, [0, 0, HEIGHT_M - lowest]).tolist(), turn)
    client.createMultiBody(0, client.createCollisionShape(pybullet.GEOM_PLANE))
    if links and not movable:
        low, high = np.array(client.getAABB(*links[0]))
        above = [*((low + high) / 2)[:2], max(high[2], 0.0) + HEIGHT_M]
        client.createMultiBody(0.033, client.createCollisionShape(pybullet.GEOM_SPHERE, radius=0.01), -1, above)
    steel = as_material("steel")
    notes = add_links(listener, dict.fromkeys(links, steel), static)
    for _ in range(STEPS):
        client.stepSimulation()
    listener.finish()
    sound = listener.sound()
    used = [resource.getrusage(who) for who in (resource.RUSAGE_SELF, resource.RUSAGE_CHILDREN)]
    ground = [note for note in notes if " is ground " in note]
    said = {listener.world.name_of(*link): _capability(listener, link, steel) for link in links}
    planes = [name for name in said if any(note.startswith(f"{name} is ground") for note in ground)]
    return {
        "name": name,
        "processor_s": round(sum(one.ru_utime + one.ru_stime for one in used), 1),
        "peak_pa": float(np.abs(sound).max(initial=0.0)),
        "links": len(links),
        "planes": len(planes),
        "touched": sum(body.model is not None and not body.model.unsolved for body in listener.contacts.bodies),
        "sounding": sum(said[one] in ("modes", "clicks") and one not in planes for one in said),
        "why_not": {one: why for one, why in said.items() if why not in ("modes", "clicks") and one not in planes},
    }


def _capability(listener: Any, link: tuple[int, int], material: Any) -> str:
    """Say whether a link has modes below 20 kHz, clicks alone, or why neither."""
    from sonic_bullet.effects.presets_of_effects import with_material
    from sonic_bullet.records.errors import SonicBulletError
    from sonic_bullet.session.body_models import analyse_body

    try:
        model = analyse_body(listener.world.shapes_of(*link), with_material(material), draft=True)
    except SonicBulletError as error:
        return error.what
    return "modes" if model.mode_count else "clicks"


def measured(name: str, limit_s: float) -> dict[str, Any]:
    """Drop a file in a process of its own that ends after so much processor time, as do its workers."""
    limit = int(limit_s)
    with tempfile.TemporaryDirectory() as cache:
        environment = {**os.environ, "SONIC_BULLET_CACHE": cache, "SONIC_BULLET_PROGRESS": "0"}
        command = [sys.executable, "-m", "benchmarks.pybullet_files", "--drop", name]
        held = partial(resource.setrlimit, resource.RLIMIT_CPU, (limit, limit))
        done = subprocess.run(
            command, capture_output=True, text=True, errors="replace", env=environment, check=False, preexec_fn=held
        )
    if done.returncode in (-signal.SIGXCPU, -signal.SIGKILL):
        return {"name": name, "failed": f"over {limit} s of processor"}
    if done.returncode == 3:
        return {"name": name, "failed": "PyBullet cannot load it"}
    if done.returncode < 0:
        return {"name": name, "failed": f"PyBullet ends by {signal.Signals(-done.returncode).name}"}
    if done.returncode:
        return {"name": name, "failed": (done.stderr.strip().splitlines() or ["no message"])[-1]}
    found: dict[str, Any] = json.loads(done.stdout.splitlines()[-1])
    return found | {"date": str(date.today())}


def _sample_note(rows: list[dict[str, Any]]) -> list[str]:
    """Say how many files are measured of each folder that is not whole, and how to make the rest."""
    there, here = (Counter(name.rpartition("/")[0].partition("/")[0] for name in names) for names in
                   (all_files(), [row["name"] for row in rows]))  # fmt: skip
    parts = [f"{here[one]} of {there[one]} in `{one or '.'}`" for one in there if here[one] < there[one]]
    if not parts:
        return []
    kept = "--kept build/pybullet-data.jsonl -o docs/measured/pybullet-data.md"
    said = (
        f"A sample of {date.today()}: {', '.join(parts)}; of all other folders every file. The whole is made by "
        f"`python -m benchmarks.pybullet_files {kept}`, which goes on where it ended."
    )
    return [*wrap(said, 120, break_long_words=False, break_on_hyphens=False), ""]


def page(rows: list[dict[str, Any]]) -> str:
    """Write the page."""
    import numpy as np

    loaded = [row for row in rows if "links" in row]
    links, good = (sum(row[one] for row in loaded) for one in ("links", "sounding"))
    good += sum(row["planes"] for row in loaded)
    seconds = [row["processor_s"] for row in loaded if row["links"]]
    lines = [
        "# PyBullet's own files",
        "",
        "Every URDF, SDF and MJCF file of pybullet_data, dropped by 0.3 m on a plane, of steel, with an empty cache:",
        "`python -m benchmarks.pybullet_files`. On what cannot move a steel ball is dropped. Seconds are of processor,",
        "to the sound of the first second, Python's start included. Links count where they collide. One that clicks",
        "has no mode below 20 kHz. Each row says its day: it is of the code and the machine of that day.",
        "",
        *_sample_note(rows),
        "| what | must hold | measured |",
        "|---|---|---|",
        f"| links that sound, click or are planes | >= {LEAST_SOUNDING:.0%} | {good / max(links, 1):.1%} of {links} |",
        f"| slowest first sound | <= {MOST_S:.0f} s | {max(seconds, default=0):.1f} s |",
        f"| median | <= {MEDIAN_S:.0f} s | {float(np.median(seconds)) if seconds else 0:.1f} s |",
        f"| files | | {len(rows)}, of which PyBullet loads {len(loaded)} |",
        "",
        "| file | seconds | links | sound | planes | touched | day | why not |",
        "|---|---|---|---|---|---|---|---|",
    ]
    for row in rows:
        if "links" not in row:
            lines.append(f"| {row['name']} | | | | | | | {row['failed']} |")
            continue
        why = "; ".join(f"{one}: {said}" for one, said in row["why_not"].items())
        numbers = f"{row['links']} | {row['sounding']} | {row['planes']} | {row['touched']} | {row['date']}"
        lines.append(f"| {row['name']} | {row['processor_s']} | {numbers} | {why} |")
    return "\n".join(lines) + "\n"


def main() -> None:
    """Measure what is not kept yet, and write the page."""
    parser = argparse.ArgumentParser()
    parser.add_argument("names", nargs="*")
    parser.add_argument("-o", "--output")
    parser.add_argument("--kept", help="lines of JSON, one a file, that are not measured again")
    parser.add_argument("--blobs", type=int, default=1000, help="how many of random_urdfs, drawn")
    parser.add_argument("--seed", type=int, default=68, help="of that draw")
    parser.add_argument("--limit", type=float, default=300.0, metavar="S", help="processor time of a file")
    parser.add_argument("--drop", help=argparse.SUPPRESS)
    asked = parser.parse_args()
    if asked.drop:
        warnings.simplefilter("ignore")
        print("\n" + json.dumps(drop(asked.drop)), flush=True)
        return
    kept = Path(asked.kept) if asked.kept else None
    names = asked.names or drawn_files(asked.blobs, asked.seed)
    rows = measure_missing(names, lambda name: measured(name, asked.limit), kept)
    if asked.output:
        Path(asked.output).write_text(page([rows[name] for name in sorted(rows)]))


if __name__ == "__main__":
    main()
