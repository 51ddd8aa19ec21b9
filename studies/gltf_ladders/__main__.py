"""Do the ladders of the draft glTF extension KHR_audio_rigid_bodies come out here as its text predicts?

    python -m studies.gltf_ladders --data ../shared/gltf-audio [--out PAGE] [LADDER ...]        half a minute

A ladder is two to four scenes that differ in one thing. Each is run for 2 s by `render_scene`, and its log once more,
watched: lengths of pulses, the contact's force at audio rate. Where we differ, the page says who is right, by a source.
"""

from __future__ import annotations

import argparse
import textwrap
from pathlib import Path

from sonic_bullet.files.storage.atomic import replace_file
from studies.gltf_ladders.impacts import IMPACTS
from studies.gltf_ladders.observed import Observed
from studies.gltf_ladders.surfaces_swept import SWEPT
from studies.gltf_ladders.verdicts import Verdict

HEAD = """# Ladders of the draft glTF extension

The draft KHR_audio_rigid_bodies comes with ladders: scenes that differ in one thing and isolate one prediction.
This page holds what its text predicts, and what `sonic-bullet render` makes of the scenes.
It is written by `python -m studies.gltf_ladders --data ../shared/gltf-audio --out PAGE`.

Rates are how often the contact's force rises through its load a second.
Levels are of 0.3 s to 2 s, re 20 µPa, 1.1 m away and more.

"""
COLUMNS = 150


def judge(data: Path, names: list[str]) -> dict[str, Verdict]:
    """Judge ladders by name; none: all of them."""
    found = {}
    for name, measure in {**IMPACTS, **SWEPT}.items():
        if names and name.split("/")[-1] not in names:
            continue
        scenes = {path.name[0]: Observed(path) for path in sorted((data / "test" / name).glob("*.gltf"))}
        found[name] = measure(scenes)
        print(f"{name.split('/')[-1]}: {found[name].verdict}: {found[name].rendered}", flush=True)
    return found


def page(found: dict[str, Verdict]) -> str:
    """Write the page."""
    text = HEAD
    for title, names in (("Impacts", IMPACTS), ("What slides and rolls", SWEPT)):
        rows = {name: found[name] for name in names if name in found}
        counts: dict[str, int] = {}
        for one in rows.values():
            counts[one.verdict] = counts.get(one.verdict, 0) + 1
        words = ", ".join(f"{verdict} {count}" for verdict, count in sorted(counts.items()))
        text += f"## {title}\n\nOf {len(rows)}: {words}.\n\n"
        text += "| ladder | predicted | rendered | verdict |\n|---|---|---|---|\n"
        for name, one in rows.items():
            text += f"| {name.split('/')[-1]} | {one.predicted} | {one.rendered} | {one.verdict} |\n"
        text += "\n"
        remarks = [_remark(name.split("/")[-1], one.right) for name, one in rows.items() if one.right]
        text += f"Who is right where both differ, or what to know:\n\n{''.join(remarks)}\n" if remarks else ""
    return text.rstrip() + "\n"


def _remark(name: str, right: str) -> str:
    return textwrap.fill(f"- **{name}**: {right}.", COLUMNS, subsequent_indent="  ") + "\n"


def main() -> None:
    """Run the command."""
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("names", nargs="*", metavar="LADDER")
    parser.add_argument("--data", type=Path, required=True)
    parser.add_argument("--out", type=Path)
    asked = parser.parse_args()
    found = judge(asked.data, asked.names)
    if asked.out is not None:
        with replace_file(asked.out) as file:
            file.write(page(found).encode())


if __name__ == "__main__":
    main()
