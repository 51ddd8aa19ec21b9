"""A folder is there whole or not at all: an error leaves the old one, and nothing beside it."""

from __future__ import annotations

from pathlib import Path

import pytest

from sonic_bullet.files.storage.atomic import replacing_folder
from sonic_bullet.records.errors import FileError


def test_a_folder_is_replaced_when_whole_and_kept_on_an_error(tmp_path: Path) -> None:
    to = tmp_path / "shards"
    for text in ("old", "new"):
        with replacing_folder(to) as folder:
            (folder / "a.txt").write_text(text)
            assert not to.exists() or (to / "a.txt").read_text() == "old"
        assert (to / "a.txt").read_text() == text
    with pytest.raises(ZeroDivisionError), replacing_folder(to) as folder:
        (folder / "a.txt").write_text("half")
        raise ZeroDivisionError
    with pytest.raises(FileError, match=r"cannot write .*shards: the disk"), replacing_folder(to):
        raise OSError(30, "the disk is read only")
    assert (to / "a.txt").read_text() == "new"
    assert [one.name for one in tmp_path.iterdir()] == ["shards"]
