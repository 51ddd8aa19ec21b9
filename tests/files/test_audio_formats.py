"""One more format of sound files is one more entry of `AUDIO_FORMATS`."""

from __future__ import annotations

import ast
import importlib
import runpy
from pathlib import Path

import numpy as np
import pytest
from click.testing import CliRunner

import sonic_bullet
from sonic_bullet.apps.cli import cli
from sonic_bullet.apps.compare import folders
from sonic_bullet.files import read_audio, read_audio_scale, write_audio
from sonic_bullet.records.file_endings import AUDIO_FORMATS, AudioFormat

PACKAGE = Path(sonic_bullet.__file__).parent
SHARED = {".wav"}  # which names files of this package's own, too


def test_a_format_more_is_written_read_compared_and_named(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setitem(AUDIO_FORMATS, ".sun", AudioFormat("AU", "FLOAT", "nowhere"))
    sound = np.sin(np.arange(4800) / 7)[None]
    write_audio(tmp_path / "a.sun", sound, 48_000)
    back, sr = read_audio(tmp_path / "a.sun")
    assert sr == 48_000 and np.abs(back - sound).max() < 1e-7
    assert read_audio_scale(tmp_path / "a.sun") is None
    folder = tmp_path / "case"
    folder.mkdir()
    (tmp_path / "a.sun").rename(folder / "a.sun")
    assert CliRunner().invoke(cli, ["case", "new", str(folder)]).exit_code == 0
    assert "a.sun" in (folder / "case.json").read_text()
    assert folders._is_compared(folder / "a.sun")
    made = runpy.run_path(importlib.import_module("sonic_bullet.options.render").__file__ or "", run_name="once_more")
    assert " .sun;" in made["RenderOptions"].__dataclass_fields__["output"].metadata["option"].help


def test_endings_are_spelled_in_one_file() -> None:
    looked_at, found = 0, []
    for path in PACKAGE.rglob("*.py"):
        for node in ast.walk(ast.parse(path.read_text(encoding="utf-8"))):
            if isinstance(node, ast.Constant) and isinstance(node.value, str):
                looked_at += 1
                if node.value in AUDIO_FORMATS.keys() - SHARED:
                    found.append(path.relative_to(PACKAGE).as_posix())
    assert looked_at > 5000
    assert set(found) == {"records/file_endings.py"}
