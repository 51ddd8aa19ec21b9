"""`sonic-bullet cache`: what is kept, by kind; bounded, cleared, as a table and as JSON."""

from __future__ import annotations

import json
from pathlib import Path

import numpy as np
import pytest
from click.testing import CliRunner, Result

from sonic_bullet.apps.cli import cli
from sonic_bullet.files.storage import cache
from sonic_bullet.records.errors import FileError
from tests.made.logs import log


@pytest.fixture
def kept(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> Path:
    """A cache with two bodies' modes, how one of them radiates, and the models of a log."""
    monkeypatch.setenv("SONIC_BULLET_CACHE", str(tmp_path / "models"))
    for kind, digit in (("modes", "1"), ("solid", "2"), ("radiation", "3")):
        cache.save("default", f"{kind}-{digit * 64}", {"x": np.zeros(1000)}, "")
    log().save(tmp_path / "log.npz", models="reference")
    return tmp_path


def called(*words: str) -> Result:
    return CliRunner().invoke(cli, ["cache", *words], catch_exceptions=False)


def counts(kinds: list[dict[str, object]]) -> dict[object, object]:
    return {kind["kind"]: kind["files"] for kind in kinds}


ALL = {"models of logs": 2, "modes": 2, "radiation": 1}


def test_it_lists_by_kind_and_changes_nothing(kept: Path) -> None:
    before = sorted(path for path in kept.rglob("*"))
    done = called()
    assert done.exit_code == 0 and str(kept / "models") in done.output
    for kind, files in ALL.items():
        assert any(line.startswith(kind) and line.split()[len(kind.split())] == str(files)
                   for line in done.output.splitlines()), done.output  # fmt: skip
    assert sorted(kept.rglob("*")) == before


def test_json_counts_every_byte(kept: Path) -> None:
    found = json.loads(called("--json=-").output)
    assert counts(found["kinds"]) == ALL and found["removed"] == [] and found["limit_bytes"] == 2_000_000_000
    files = [path for path in (kept / "models").rglob("*") if path.is_file()]
    assert sum(kind["bytes"] for kind in found["kinds"]) == sum(path.stat().st_size for path in files)


def test_clear_removes_all(kept: Path) -> None:
    found = json.loads(called("--clear", "--json=-").output)
    assert counts(found["removed"]) == ALL and found["kinds"] == []
    assert not [path for path in (kept / "models").rglob("*") if path.is_file()]
    assert "0.0 MB in all" in called().output


def test_a_limit_takes_models_of_logs_last(kept: Path) -> None:
    sizes = {path.name: path.stat().st_size for path in (kept / "models").iterdir()}
    of_logs = sum(size for name, size in sizes.items() if name.startswith("model-"))
    found = json.loads(called("--limit", f"{of_logs}B", "--json=-").output)
    assert counts(found["kinds"]) == {"models of logs": 2}
    assert counts(found["removed"]) == {"modes": 2, "radiation": 1}
    assert counts(json.loads(called("--limit", "0", "--json=-").output)["kinds"]) == {}


def test_wrong_words_are_named_and_nothing_is_removed(kept: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    before = sorted(kept.rglob("*"))
    with pytest.raises(FileError, match="--limit is 'much'"):
        called("--limit", "much")
    assert called("--clear", "--limit", "1GB").exit_code == 2
    monkeypatch.setenv("SONIC_BULLET_CACHE_LIMIT", "x")
    with pytest.raises(FileError, match="SONIC_BULLET_CACHE_LIMIT is 'x'"):
        called("--clear")
    assert sorted(kept.rglob("*")) == before
