"""`sonic-bullet compare` and `baseline` as a shell sees them: exit codes, lines, JSON, the page; never a traceback."""

from __future__ import annotations

import json
import re
import subprocess
from pathlib import Path

import msgspec
import pytest
from click.testing import CliRunner, Result

from sonic_bullet.apps.cli import cli
from sonic_bullet.apps.compare.baselines import BASELINE_FORMAT, SceneBaseline, read_baseline, write_baseline
from sonic_bullet.records.errors import CompareError, FileError, SonicBulletError
from tests.apps.compare.made import scene

HEAVIER = ("        0.004,", "        0.0044,")
HOSTILE = ('"name": "ball"}', '"name": "<script>alert(1)</script>"}')


def shell(*words: object) -> Result:
    return CliRunner().invoke(cli, [str(word) for word in words])


def test_what_differs_is_named_and_exits_with_1(tmp_path: Path) -> None:
    a, b = scene(tmp_path, "a.py"), scene(tmp_path, "b.py", HEAVIER)
    done = shell("compare", a, b, "--json", tmp_path / "out.json", "--report", tmp_path / "out.html")
    assert done.exit_code == 1
    assert "ball: mass 0.004 → 0.0044 kg (+10 %): put back, the scene is A to the bit" in done.output
    assert "compared 1: 0 the same, 1 differ" in done.output
    found = json.loads((tmp_path / "out.json").read_text())
    assert found["pairs"][0]["differences"][0]["cause"] is True
    page = (tmp_path / "out.html").read_text()
    assert page.index("mass 0.004") < page.index("<audio")
    assert page.count("<audio") == 2
    assert not re.search(r"(src|href)=\"?https?:", page)
    assert len(page) < 5e6 / 20


def test_what_is_the_same_exits_with_0(tmp_path: Path) -> None:
    a = scene(tmp_path, "a.py")
    done = shell("compare", a, a)
    assert done.exit_code == 0, done.output
    assert "same: all samples are equal" in done.output


def test_names_do_not_run_in_the_page(tmp_path: Path) -> None:
    a, b = scene(tmp_path, "a.py", HOSTILE), scene(tmp_path, "b.py", HOSTILE, HEAVIER)
    assert shell("compare", a, b, "--report", tmp_path / "out.html").exit_code == 1
    page = (tmp_path / "out.html").read_text()
    assert "<script>alert" not in page
    assert "&lt;script&gt;alert(1)&lt;/script&gt;" in page
    assert page.count("<script>") == 1
    assert "default-src 'none'" in page
    assert "unsafe" not in page


def test_folders_are_paired_by_name_and_a_missing_partner_is_said(tmp_path: Path) -> None:
    for side in ("old", "new"):
        (tmp_path / side).mkdir()
        scene(tmp_path / side, "same.py")
    scene(tmp_path / "old", "gone.py")
    (tmp_path / "old" / "helper.py").write_text("X = 1\n")
    done = shell("compare", tmp_path / "old", tmp_path / "new")
    assert done.exit_code == 1
    assert "gone.py: is in A alone" in done.output
    assert "compared 1: 1 the same, 0 differ, 1 not compared" in done.output


def test_a_revision_is_compared_with_the_working_tree(tmp_path: Path) -> None:
    a = scene(tmp_path, "a.py")
    git = ["git", "-C", str(tmp_path), "-c", "user.name=x", "-c", "user.email=x@y", "-c", "init.defaultBranch=main"]
    for words in (["init", "-q"], ["add", "a.py"], ["commit", "-qm", "a"]):
        subprocess.run([*git, *words], check=True)
    assert shell("compare", a, "--ref", "HEAD").exit_code == 0
    scene(tmp_path, "a.py", HEAVIER)
    done = shell("compare", a, "--ref", "HEAD")
    assert done.exit_code == 1
    assert "mass 0.004 → 0.0044" in done.output
    assert subprocess.run([*git, "worktree", "list"], capture_output=True, check=True).stdout.count(b"\n") == 1
    gone = shell("compare", a, "--ref", "no-such")
    assert isinstance(gone.exception, CompareError)
    assert "there is no revision 'no-such'" in str(gone.exception)


def test_wrong_use_is_named(tmp_path: Path) -> None:
    a = scene(tmp_path, "a.py")
    for words, said in (
        ([a], "compare needs two things"),
        ([a, tmp_path / "none.py"], "there is no"),
        ([a, tmp_path], "one is a folder"),
        ([a, a, "--report", "x.txt"], "a report is a page"),
    ):
        done = shell("compare", *words)
        assert isinstance(done.exception, SonicBulletError)
        assert said in str(done.exception)


def test_a_baseline_comes_back_and_one_of_another_version_is_refused(tmp_path: Path) -> None:
    a = scene(tmp_path, "a.py")
    done = shell("baseline", a, "-o", tmp_path / "kept", "--runs", 0, "--reason", "as tuned")
    assert done.exit_code == 0, done.output
    known = read_baseline(tmp_path / "kept" / "a.json")
    assert isinstance(known, SceneBaseline)
    assert (known.format, known.reason, known.scene) == (BASELINE_FORMAT, "as tuned", "a.py")
    assert (tmp_path / "kept" / "a.json").stat().st_size < 10_000
    write_baseline(tmp_path / "old.json", msgspec.structs.replace(known, format="sonic_bullet baseline 0"))
    with pytest.raises(FileError, match="no longer read; make it anew"):
        read_baseline(tmp_path / "old.json")
    (tmp_path / "bad.json").write_text("[1")
    with pytest.raises(FileError, match="ends too early"):
        read_baseline(tmp_path / "bad.json")


def test_a_baseline_into_a_file_is_one_line(tmp_path: Path) -> None:
    (tmp_path / "there").write_text("kept")
    done = shell("baseline", scene(tmp_path, "a.py"), "-o", tmp_path / "there")
    assert isinstance(done.exception, FileError)
    assert "cannot make the folder" in str(done.exception)
    assert (tmp_path / "there").read_text() == "kept"


def test_what_passes_within_a_tolerance_is_called_the_same(tmp_path: Path) -> None:
    a, b = scene(tmp_path, "a.py"), scene(tmp_path, "b.py", ("(0.0, -0.4, 0.3)", "(0.0, -0.41, 0.3)"))
    assert shell("baseline", a, "-o", tmp_path, "--runs", 0).exit_code == 0
    for old, head in (
        (tmp_path / "a.json", "the same within 3 dB: samples differ from those of a.json\n"),
        (a, "the same within 3 dB: samples differ; microphone 1 moved by 10 mm"),
    ):
        done = shell("compare", old, b, "--tolerance-db", 3)
        assert done.exit_code == 0, done.output
        assert done.output.startswith(head)
        assert "compared 1: 1 the same, 0 differ" in done.output
