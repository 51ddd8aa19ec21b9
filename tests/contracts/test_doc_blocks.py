"""Every block of Python and of the shell in the documentation runs, page by page, in the order in which it stands.

A page has a folder of its own with `scenes`, `assets`, two recordings of a small brass bar
(tap.wav, tap2.wav, bar.obj) and a case of it (my_case).
A block that cannot run says so and why behind its language: ```python not run: reason. Such blocks are counted.
README's Python and `sh` blocks run in tests/test_readme.py; the example of an effect also runs on recordings, in
tests/lab/diagnosis/test_found_again.py.
"""

from __future__ import annotations

import json
import re
import shlex
import shutil
import sys
from pathlib import Path
from typing import Any

import click
import pytest

from sonic_bullet.apps.cli import cli, main
from sonic_bullet.records import Material
from sonic_bullet.simulators import disconnect
from tests.made.case import make

REPO = Path(__file__).resolve().parents[2]
PAGES = sorted((*(REPO / "docs").rglob("*.md"), REPO / "README.md"))
BLOCK = re.compile(r"^```(python|console|sh|bash)([^\n]*)\n(.*?)^```", re.S | re.M)
BRASS = Material.isotropic("made", youngs_pa=1.0e11, poisson=0.36, density_kg_m3=8400, alpha_per_s=8.0, beta_s=4e-8)
MOST_NOT_RUN = 0
LONG = {"fit", "residual", "diagnose", "states"}  # of README: how-to pages and journeys run the same


def blocks(page: Path) -> list[tuple[str, str, str]]:
    """(language, what is said behind it, source) in order."""
    return [(m[1], m[2].strip(), m[3]) for m in BLOCK.finditer(page.read_text(encoding="utf-8"))]


def commands(source: str) -> list[list[str]]:
    return [
        shlex.split(line, comments=True)
        for line in source.replace("\\\n", " ").splitlines()
        if line.strip() and not line.startswith("#")
    ]


WITH_BLOCKS = [page for page in PAGES if blocks(page)]


@pytest.fixture(scope="module")
def made(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """A case of a brass bar up to 6 kHz, four strikes."""
    folder = tmp_path_factory.mktemp("made") / "my_case"
    folder.mkdir()
    make(folder, BRASS, (0.12, 0.025, 0.006), guess=(1.1e11, 8400.0, 0.34), strikes=4, seconds=0.25, band_hz=[20, 6000])
    return folder


@pytest.fixture
def place(made: Path, tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> Path:
    for name in ("scenes", "assets"):
        shutil.copytree(REPO / name, tmp_path / name)  # commands write beside scenes
    shutil.copytree(made, tmp_path / "my_case")
    for name, source in (("tap.wav", "s0.wav"), ("tap2.wav", "s1.wav"), ("bar.obj", "box.obj")):
        shutil.copy(made / source, tmp_path / name)
    monkeypatch.chdir(tmp_path)
    return tmp_path


def run_command(words: list[str]) -> None:
    """A line of a shell block: sonic-bullet runs, make and python name what there is, nothing else is done."""
    if words[0] == "sonic-bullet":
        small = {"film": "--size", "--film": "--film-size"}  # pictures are what takes long
        sys.argv = words + [word for name, size in small.items() if name in words for word in (size, "320x180")]
        with pytest.raises(SystemExit) as ended:
            main()
        assert not ended.value.code, words
    elif words[0] == "make":
        assert re.search(rf"(?m)^{words[1]}:", (REPO / "Makefile").read_text()), words
    elif words[0] == "python":
        assert (REPO / words[1]).is_file() or words[1] == "-m", words
    else:
        assert words[0] in {"git", "cd", "pip"}, words


def understood(words: list[str]) -> None:
    """A sonic-bullet line that is not run: click takes its options."""
    command = cli.commands[words[1]]
    with click.Context(command, info_name=words[1]) as context:
        command.parse_args(context, list(words[2:]))


@pytest.mark.parametrize("page", WITH_BLOCKS, ids=lambda page: page.relative_to(REPO).as_posix())
def test_blocks_run(page: Path, place: Path, capfd: pytest.CaptureFixture[str]) -> None:
    names: dict[str, Any] = {"__name__": "page"}
    count = 0
    readme = page.name == "README.md" and page.parent == REPO
    for language, said, source in blocks(page):
        assert not said or said.startswith("not run: "), f"{page}: {said}"
        if said or (readme and language != "console"):
            continue
        if language == "python":
            for library in ("panda_gym", "torch"):
                if re.search(rf"import .*\b{library}\b", source):
                    pytest.importorskip(library)
            exec(compile(source, page.name, "exec", dont_inherit=True), names)
            count += 1
            continue
        for words in commands(source):
            (understood if readme and words[1] in LONG else run_command)(words)
            count += 1
    for value in names.values():
        if type(value).__name__ == "BulletClient" and value.isConnected():
            disconnect(value)  # its finaliser would end whoever has its id next
    assert count
    assert "Traceback" not in capfd.readouterr().err


def test_what_does_not_run_is_counted() -> None:
    idle = [f"{page.name}: {said}" for page in PAGES for _, said, _ in blocks(page) if said]
    assert len(idle) == MOST_NOT_RUN, idle
    assert sum(len(blocks(page)) for page in PAGES) > 25


def test_fenced_blocks_say_their_language() -> None:
    """A fence without a language would run nowhere and unnoticed."""
    for page in PAGES:
        fences = re.findall(r"^```(.*)$", page.read_text(encoding="utf-8"), re.M)
        assert all(fences[::2]), page.name
        assert {f.split()[0] for f in fences[::2]} <= {"python", "console", "sh", "text", "json"}, page.name


def test_blocks_of_json_are_json() -> None:
    for page in PAGES:
        for source in re.findall(r"^```json\n(.*?)^```", page.read_text(encoding="utf-8"), re.S | re.M):
            json.loads(source)
