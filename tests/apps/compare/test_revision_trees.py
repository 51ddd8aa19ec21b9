"""`compare --ref`: the old side runs in a whole tree of the revision, and what neither side can pin is named."""

from __future__ import annotations

import os
import subprocess
import sys
import tempfile
from pathlib import Path

import pytest

from sonic_bullet.apps.compare.revision_tree import RevisionTree, find_unpinned, unpinned_words
from sonic_bullet.apps.compare.revisions import at_revision
from tests.apps.compare.made import SCENE, scene
from tests.apps.compare.test_compare_command import shell

MOST_NAMED = 8

REPO = Path(__file__).resolve().parents[3]
MASS = "        0.004, client"
OBJ = "\n".join(
    [
        *(f"v {x} {y} {z}" for x in (-1, 1) for y in (-1, 1) for z in (-1, 1)),
        *(f"f {a} {b} {c}" for a, b, c in ((1, 3, 4), (1, 4, 2), (5, 6, 8), (5, 8, 7), (1, 2, 6), (1, 6, 5))),
        *(f"f {a} {b} {c}" for a, b, c in ((3, 7, 8), (3, 8, 4), (1, 5, 7), (1, 7, 3), (2, 4, 8), (2, 8, 6))),
    ]
)


def commit(top: Path) -> None:
    """All of the folder into a repository of its own."""
    git = ["git", "-C", str(top), "-c", "user.name=x", "-c", "user.email=x@y", "-c", "init.defaultBranch=main"]
    for words in (["init", "-q"], ["add", "."], ["commit", "-qm", "a"]):
        subprocess.run([*git, *words], check=True)


def with_head(top: Path, *changes: tuple[str, str], head: str = "") -> Path:
    """The scene in a folder below ``top``, with lines before its own."""
    (top / "scenes").mkdir(exist_ok=True)
    place = scene(top / "scenes", "a.py", *changes)
    place.write_text(head + place.read_text())
    return place


def differs(place: Path, words: str = "mass 0.004 → 0.0044") -> None:
    done = shell("compare", place, "--ref", "HEAD")
    assert done.exit_code == 1, (done.output, done.exception)
    assert words in done.output


def test_a_module_one_folder_above_the_scene_is_the_revisions(tmp_path: Path) -> None:
    above = "import os, sys\nsys.path.insert(0, os.path.dirname(os.path.dirname(os.path.abspath(__file__))))\n"
    place = with_head(tmp_path, (MASS, "        cup.MASS, client"), head=f"{above}import cup\n")
    (tmp_path / "cup.py").write_text("MASS = 0.004\n")
    commit(tmp_path)
    assert shell("compare", place, "--ref", "HEAD").exit_code == 0
    (tmp_path / "cup.py").write_text("MASS = 0.0044\n")
    before = list(sys.path)
    differs(place)
    assert "cup" not in sys.modules
    assert sys.path == before


def test_an_asset_relative_to_the_working_folder_is_the_revisions(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    place = with_head(tmp_path, (MASS, '        float(open("data/mass.txt").read()), client'))
    (tmp_path / "data").mkdir()
    (tmp_path / "data" / "mass.txt").write_text("0.004")
    commit(tmp_path)
    (tmp_path / "data" / "mass.txt").write_text("0.0044")
    monkeypatch.chdir(tmp_path)
    differs(place)
    assert Path.cwd() == tmp_path


def test_a_mesh_of_the_same_name_is_read_anew_by_pybullet(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    """PyBullet keeps what it has read by its name, and both sides name it alike."""
    shape = "client.GEOM_BOX, halfExtents=[0.12, 0.005, 0.005]"
    place = with_head(tmp_path, (shape, 'client.GEOM_MESH, fileName="bar.obj", meshScale=[0.12, 0.005, 0.005]'))
    (tmp_path / "bar.obj").write_text(OBJ)
    commit(tmp_path)
    monkeypatch.chdir(tmp_path)
    assert shell("compare", place, "--ref", "HEAD").exit_code == 0
    (tmp_path / "bar.obj").write_text(OBJ.replace("v 1 ", "v 0.9 "))
    differs(place, "bar.obj")


def test_a_package_without_a_file_on_the_import_path_is_the_revisions(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    place = with_head(tmp_path, (MASS, "        kitchen.cup.MASS, client"), head="import kitchen.cup\n")
    (tmp_path / "lib" / "kitchen").mkdir(parents=True)
    (tmp_path / "lib" / "kitchen" / "cup.py").write_text("from kitchen import mug\nMASS = mug.MASS\n")
    (tmp_path / "lib" / "kitchen" / "mug.py").write_text("MASS = 0.004\n")
    commit(tmp_path)
    (tmp_path / "lib" / "kitchen" / "mug.py").write_text("MASS = 0.0044\n")
    monkeypatch.syspath_prepend(tmp_path / "lib")
    differs(place)


def test_a_module_that_is_new_is_not_the_old_sides(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    """Named by its absolute path in the working tree, and imported where there is one."""
    head = f"import sys\nsys.path.insert(0, {str(tmp_path)!r})\ntry:\n    from cup import MASS\n"
    place = with_head(tmp_path, (MASS, "        MASS, client"), head=f"{head}except ImportError:\n    MASS = 0.004\n")
    commit(tmp_path)
    (tmp_path / "cup.py").write_text("MASS = 0.0044\n")
    subprocess.run(["git", "-C", str(tmp_path), "add", "cup.py"], check=True)
    differs(place)


def test_what_no_revision_holds_is_named(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    top = tmp_path / "top"
    top.mkdir()
    outside, known = tmp_path / "outside.txt", top / "known.txt"
    names = f"[{str(outside)!r}, {str(known)!r}, 'untracked.txt']"
    place = with_head(top, (MASS, f"        min(float(open(name).read()) for name in {names}), client"))
    for path in (outside, known):
        path.write_text("0.004")
    commit(top)
    (top / "untracked.txt").write_text("0.004")
    monkeypatch.chdir(top)
    done = shell("compare", place, "--ref", "HEAD")
    assert done.exit_code == 0, (done.output, done.exception)
    note = next(line for line in done.output.splitlines() if "note: both sides read the same" in line)
    assert f"{outside} (outside the repository)" in note
    assert f"{known} (by its absolute path" in note
    assert "untracked.txt (git does not know it)" in note
    assert note.count("(") == 3, note
    assert unpinned_words({f"{i}" for i in range(MOST_NAMED + 2)})[0].endswith(", and 2 more")


def test_what_python_reads_of_an_installed_package_is_not_named(tmp_path: Path) -> None:
    place = tmp_path / "else.egg-info" / "entry_points.txt"
    place.parent.mkdir()
    for path in (place, tmp_path / "else.txt"):
        path.write_text("")
    revision = RevisionTree(tmp_path / "top", tmp_path / "tree")
    found = find_unpinned({str(place), str(tmp_path / "else.txt")}, revision, old=True)
    assert found == {f"{tmp_path / 'else.txt'} (outside the repository)"}


def test_the_tree_is_whole_and_leaves_nothing_in_the_repository(tmp_path: Path) -> None:
    (tmp_path / ".gitattributes").write_text("hidden.txt export-ignore\n")
    (tmp_path / "hidden.txt").write_text("kept")
    place = with_head(tmp_path)
    commit(tmp_path)
    before = sorted(path for path in (tmp_path / ".git").rglob("*"))
    with at_revision(str(place), "HEAD") as (there, revision):
        assert Path(there).read_text() == SCENE
        assert (revision.tree / "hidden.txt").read_text() == "kept"
        folder = revision.tree.parent
    assert not folder.exists()
    assert sorted(path for path in (tmp_path / ".git").rglob("*")) == before
    assert not os.listdir(tempfile.gettempdir()).count(folder.name)
