"""Pictures and sounds of the site: run the examples and scenes that pages show, and bake the bodies, into build/media.

python docs/make_media.py                        those whose script, or the package, has changed since
python docs/make_media.py examples/takes.py …    these; of bodies assets/bowl.obj:steel
python docs/make_media.py README.md              the README's first example -> docs/start/pictures/first-sound.png
"""

from __future__ import annotations

import hashlib
import json
import os
import re
import shutil
import subprocess
import sys
import tempfile
from pathlib import Path

REPO = Path(__file__).resolve().parents[1]
MEDIA = REPO / "build" / "media"
FIRST = REPO / "docs" / "start" / "pictures" / "first-sound.png"
SHOWN = re.compile(r"^\[(Picture and sound of )?((?:examples|scenes)/\w+)\.py\]\([./]*\2\.py\)$", re.M)
"""A line of a page that shows a script: a link to it and nothing else, with or without its code."""

STRUCK = re.compile(r"^\[Strike the \w+ of (\w+)\]\([./]*(assets/\w+)\.obj\)$", re.M)
"""A line of a page on whose site a body is struck: a link to its mesh and nothing else, naming its material."""

RENDER = "from sonic_bullet.apps.cli import main; main()"


def shown_scripts() -> list[Path]:
    """Return the scripts that pages show."""
    pages = sorted((REPO / "docs").rglob("*.md"))
    names = (found[2] for page in pages for found in SHOWN.finditer(page.read_text(encoding="utf-8")))
    return [REPO / f"{name}.py" for name in dict.fromkeys(names)]


def struck_bodies() -> list[str]:
    """Return the bodies that pages let one strike, as MESH:MATERIAL."""
    pages = sorted((REPO / "docs").rglob("*.md"))
    found = (one for page in pages for one in STRUCK.findall(page.read_text(encoding="utf-8")))
    return list(dict.fromkeys(f"{mesh}.obj:{material}" for material, mesh in found))


def struck_page(mesh: str, material: str) -> str:
    """Return the name of a body's page below build/media."""
    return f"struck/{Path(mesh).stem}-{material}.html"


def content_key(script: Path) -> str:
    """Return a sum of all that a script's output hangs on: itself, the scenes and meshes, the package."""
    sources = [path for folder in ("sonic_bullet", "scenes", "assets") for path in (REPO / folder).rglob("*")]
    found = hashlib.sha256(script.read_bytes())
    for path in sorted(sources):
        if path.suffix in {".py", ".obj", ".json", ".js", ".css", ".jinja"}:
            found.update(path.read_bytes())
    return found.hexdigest()


def run_script(script: Path, folder: Path) -> None:
    """Run an example, or render a scene, in a folder; raises CalledProcessError."""
    command = [str(script)]
    if script.parent.name == "scenes":
        sound, picture = (f"{script.stem}.{end}" for end in ("flac", "png"))
        command = ["-c", RENDER, "render", str(script), "-o", sound, "--picture", picture]
    run_python(command, folder)


def run_python(command: list[str], folder: Path) -> None:
    """Run Python with the package in a folder; raises CalledProcessError."""
    paths = os.pathsep.join(filter(None, [str(REPO), os.environ.get("PYTHONPATH")]))
    environment = os.environ | {"MPLBACKEND": "Agg", "PYTHONPATH": paths}
    subprocess.run([sys.executable, *command], cwd=folder, env=environment, stdout=subprocess.DEVNULL, check=True)


def bake(mesh: str, material: str) -> None:
    """Put the page on which a body is struck into build/media."""
    to = MEDIA / struck_page(mesh, material)
    to.parent.mkdir(parents=True, exist_ok=True)
    run_python(["-c", RENDER, "bake", str(REPO / mesh), "--material", material, "-o", str(to)], REPO)


def make(script: Path) -> None:
    """Put a script's picture and sound into build/media; raises FileNotFoundError where it makes none."""
    to = MEDIA / script.parent.name
    to.mkdir(parents=True, exist_ok=True)
    with tempfile.TemporaryDirectory() as folder:
        run_script(script, Path(folder))
        for end in ("png", "flac"):
            shutil.move(Path(folder) / f"{script.stem}.{end}", to / f"{script.stem}.{end}")


def draw_first_sound() -> None:
    """Run the README's first example, and draw the spectrogram that stands beside it."""
    import numpy as np
    from matplotlib.figure import Figure

    import sonic_bullet as sb
    from sonic_bullet.apps.report.plots.scene_plot import spectrogram_db

    readme = (REPO / "README.md").read_text(encoding="utf-8")
    source = re.findall(r"```python\n(.*?)```", readme, re.S)[0]
    with tempfile.TemporaryDirectory() as folder:
        subprocess.run([sys.executable, "-c", source], cwd=folder, check=True)
        sound, sr = sb.read_audio(f"{folder}/bar.wav")
    freq_hz, time_s, level_db = spectrogram_db(sound, sr)
    figure = Figure(figsize=(3.6, 4.8), dpi=120, layout="constrained")
    axis = figure.subplots()
    edges = (time_s[0], time_s[-1], 0, freq_hz[-1] / 1000)
    top = level_db.max()
    axis.imshow(
        np.maximum(level_db, top - 80),
        origin="lower",
        aspect="auto",
        cmap="magma",
        vmin=top - 80,
        vmax=top,
        extent=edges,
    )
    axis.set(xlabel="time in s", ylabel="frequency in kHz", ylim=(0, 20))
    FIRST.parent.mkdir(exist_ok=True)
    figure.savefig(FIRST, metadata={"Software": None})


def main(names: list[str]) -> None:
    """Make what is asked for, or what is out of date."""
    if names == ["README.md"]:
        draw_first_sound()
        return
    book = MEDIA / "made.json"
    made = json.loads(book.read_text()) if book.is_file() else {}
    for name in names or [*(one.relative_to(REPO).as_posix() for one in shown_scripts()), *struck_bodies()]:
        source, _, material = name.partition(":")
        key = content_key(REPO / source)
        if not names and made.get(name) == key:
            continue
        print(f"running {name}", flush=True)
        if material:
            bake(source, material)
        else:
            make(REPO / source)
        made[name] = key
        book.write_text(json.dumps(made, indent=1))


if __name__ == "__main__":
    main(sys.argv[1:])
