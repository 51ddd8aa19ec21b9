"""Does a killed run ever leave half a file under a name, or litter that outlives the next run?

300 kills aimed at writes.

    python studies/kills.py [--kills 300] [--kinds .wav,.flac,…] [--seed 0] [--json]

A forked process writes one file over and over, each time with other content; at a random moment of its second or third
write it is killed (SIGKILL). Counted: whole (the name holds one of the versions, entire), in a write (the kill left an
unfinished file behind: it hit), litter (anything but the name there after the next write into that folder). Exit 1
where anything is not whole or left.
"""

from __future__ import annotations

import argparse
import json
import os
import signal
import sys
import tempfile
import time
from collections.abc import Callable
from dataclasses import dataclass
from functools import cache as cache_result
from pathlib import Path
from typing import Any

import numpy as np

SR, FRAMES = 48_000, 96_000
KINDS = (".wav", ".flac", ".ogg", ".aiff", ".caf", ".npz", "preset", ".png", "cache")


@dataclass(frozen=True)
class Kind:
    """name: of the file; write(folder, version): the file again; version(folder): which it holds, None where it is not
    entire.
    """

    name: str
    write: Callable[[Path, int], Any]
    version: Callable[[Path], int | None]


def kinds() -> dict[str, Kind]:
    """What is written, by kind."""
    from sonic_bullet.apps.report.plots.scene_plot import render_picture
    from sonic_bullet.files import presets, read_audio, read_log, write_audio, write_log
    from sonic_bullet.files.contact_log import ContactLog
    from sonic_bullet.files.storage import cache
    from sonic_bullet.records import Microphone
    from sonic_bullet.records.contacts import Contacts, Step

    sound = 0.3 * np.sin(0.1 * np.arange(FRAMES))[None, :]

    def audio(extension: str) -> Kind:
        def version(folder: Path) -> int | None:
            found, sr = read_audio(folder / f"a{extension}")
            near = found.shape == sound.shape and np.abs(found - sound).max() < (0.03 if extension == ".ogg" else 1e-6)
            return round(sr / 1000) - 40 if near else None

        return Kind(
            f"a{extension}", lambda folder, v: write_audio(folder / f"a{extension}", sound, (40 + v) * 1000), version
        )

    @cache_result
    def log_of(v: int) -> ContactLog:
        step = Step(v / 1000, np.zeros((0, 3)), np.zeros((0, 4)), np.zeros(0, bool), Contacts.none())
        return ContactLog((), (step,) * 5000, (Microphone(np.array([0.0, -1.0, 0.5])),), SR, 0)

    def log_version(folder: Path) -> int | None:
        values = {round(step.dt_s * 1000) for step in read_log(folder / "a.npz").steps}
        return values.pop() if len(values) == 1 else None

    def cache_version(folder: Path) -> int | None:
        found = cache.load(folder, "modes-0")
        return (
            None
            if found is None or (found[0]["shape"] != found[0]["shape"].flat[0]).any()
            else int(found[0]["shape"].flat[0])
        )

    def picture_version(folder: Path) -> int | None:
        from matplotlib.image import imread

        return 0 if imread(folder / "a.png").size else None

    steel = presets.named_preset("steel")
    import msgspec

    made = {extension: audio(extension) for extension in (".wav", ".flac", ".ogg", ".aiff", ".caf")}
    made[".npz"] = Kind("a.npz", lambda folder, v: write_log(folder / "a.npz", log_of(v)), log_version)
    made["preset"] = Kind(
        "a.json",
        lambda folder, v: presets.write_preset(
            folder / "a.json", msgspec.structs.replace(steel, density_kg_m3=float(v + 1))
        ),
        lambda folder: int(presets.read_preset(folder / "a.json").density_kg_m3) - 1,
    )
    made[".png"] = Kind(
        "a.png", lambda folder, v: render_picture(folder / "a.png", sound[:, :4000], SR), picture_version
    )
    made["cache"] = Kind(
        "modes-0.npz",
        lambda folder, v: cache.save(folder, "modes-0", {"shape": np.full((400, 300), float(v))}, ""),
        cache_version,
    )
    return made


def killed(kind: Kind, folder: Path, after_s: float) -> None:
    """Write versions 1, 2, … in another process, and kill it ``after_s`` after the first."""
    read, write = os.pipe()
    number = os.fork()
    if number == 0:
        try:
            for version in range(1, 10_000):
                kind.write(folder, 1 + version % 8)
                os.write(write, b".") if version == 1 else None
        finally:
            os._exit(1)
    os.close(write)
    os.read(read, 1)
    os.close(read)
    time.sleep(after_s)
    os.kill(number, signal.SIGKILL)
    os.waitpid(number, 0)


def run(names: list[str], count: int, seed: int) -> dict[str, dict[str, int]]:
    """Counts by kind of ``count`` kills in all."""
    rng, made = np.random.default_rng(seed), kinds()
    found = {name: {"kills": 0, "whole": 0, "in a write": 0, "litter": 0} for name in names}
    for i in range(count):
        name = names[i % len(names)]
        kind, counts = made[name], found[name]
        with tempfile.TemporaryDirectory(prefix="kills-") as place:
            folder = Path(place)
            kind.write(folder, 1)
            start = time.perf_counter()
            kind.write(folder, 1)
            lasts_s = time.perf_counter() - start
            there = {path.name for path in folder.iterdir()}
            killed(kind, folder, rng.uniform(0, 2) * lasts_s)
            counts["kills"] += 1
            counts["in a write"] += {path.name for path in folder.iterdir()} != there
            try:
                counts["whole"] += kind.version(folder) is not None
            except Exception as error:
                print(f"{name}: {type(error).__name__}: {error}", file=sys.stderr)
            kind.write(folder, 1)
            counts["litter"] += {path.name for path in folder.iterdir()} != there
    return found


def main() -> None:
    """The figures, a line a kind and one for all."""
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("--kills", type=int, default=300)
    parser.add_argument("--kinds", default=",".join(KINDS))
    parser.add_argument("--seed", type=int, default=0)
    parser.add_argument("--json", action="store_true")
    asked = parser.parse_args()
    found = run(asked.kinds.split(","), asked.kills, asked.seed)
    total = {key: sum(counts[key] for counts in found.values()) for key in ("kills", "whole", "in a write", "litter")}
    if asked.json:
        print(json.dumps({**found, "all": total}))
    else:
        for name, counts in {**found, "all": total}.items():
            print(
                f"{name:9} {counts['kills']} kills: {counts['whole']} whole, {counts['in a write']} in a "
                f"write, {counts['litter']} with litter after the next"
            )
    sys.exit(total["whole"] != total["kills"] or total["litter"] > 0)


if __name__ == "__main__":
    main()
