"""Strike the objects of household sets again: many clips of each, at the cost of known ones, in a folder of their own.

    python -m studies.sim_to_real.strikes SET [SET ...] --out STRIKES [--each 5] [--seed 7] [--without NAME ...]

All but the object and its stiffness is drawn anew: size, loss, support, striker, place, microphone and room. The first
strike of every object comes before the second one of any, so that a run that is stopped has all objects. --without
leaves a piece of physics out, as of `dataset household`: the same strikes, each without it.
"""

from __future__ import annotations

import argparse
import json
from collections.abc import Iterator
from dataclasses import replace
from pathlib import Path
from typing import Any

import numpy as np

from sonic_bullet.apps.dataset.household.clips import draw_clip
from sonic_bullet.apps.dataset.household.objects import DrawnObject
from sonic_bullet.apps.dataset.household.recipe import PHYSICS
from sonic_bullet.apps.dataset.household.sounding import sound_of
from sonic_bullet.apps.jobs.job_folder import append_json_line
from sonic_bullet.files.audio import write_audio
from sonic_bullet.machine.parallel import one_thread
from sonic_bullet.machine.progress import without_progress
from sonic_bullet.options.dataset import HouseholdOptions

SR = 24_000


def objects_of(sets: list[Path]) -> dict[str, tuple[DrawnObject, int]]:
    """Return by name the objects of sets, each with the seed of its stiffness."""
    found = {}
    for folder in sets:
        for text in (folder / "manifest.jsonl").read_text().splitlines():
            line = json.loads(text)
            of = line["parameters"]
            made = DrawnObject(line["object"], of["kind"], of["material"], of["wall_m"], of["shape_seed"])
            found[made.name] = made, of["seeds"][0]
    return found


@one_thread()
def strike(out: Path, sets: list[Path], each: int, seed: int, options: HouseholdOptions) -> Iterator[dict[str, Any]]:
    """Make the clips that the folder has not; yield their lines of the manifest."""
    manifest = out / "manifest.jsonl"
    done = {json.loads(text)["number"] for text in manifest.read_text().splitlines()} if manifest.exists() else set()
    known = objects_of(sets)
    for nth in range(each):
        for at, (made, elastic_seed) in enumerate(known.values()):
            number = nth * len(known) + at
            if number in done:
                continue
            drawn = draw_clip(np.random.default_rng([seed, nth, at]), options)
            clip = replace(drawn, object=made, elastic_seed=elastic_seed)
            with without_progress():
                sound, _ = sound_of(clip, options, SR, number)
            place = out / f"{number:06d}.wav"
            write_audio(place, sound, SR, subtype="FLOAT")
            line = {"audio": place.name, "number": number, "object": made.name, "parameters": clip.parameters()}
            append_json_line(manifest, line)
            yield line


def main() -> None:
    """Print a line a clip."""
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("sets", type=Path, nargs="+", metavar="SET")
    parser.add_argument("--out", type=Path, required=True)
    parser.add_argument("--each", type=int, default=5)
    parser.add_argument("--seed", type=int, default=7)
    parser.add_argument("--without", nargs="*", default=[], choices=PHYSICS)
    asked = parser.parse_args()
    asked.out.mkdir(parents=True, exist_ok=True)
    options = HouseholdOptions(excitations=("finger", "stick", "metal"), without=tuple(asked.without))
    for line in strike(asked.out, asked.sets, asked.each, asked.seed, options):
        print(line["number"], line["object"], flush=True)


if __name__ == "__main__":
    main()
