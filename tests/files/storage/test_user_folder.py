"""The user's cache folder: this user's alone, made with its parents; nowhere to keep anything is no error."""

from __future__ import annotations

import os
import stat
from pathlib import Path

import pytest

from sonic_bullet.files.storage import user_folder
from sonic_bullet.files.storage.user_folder import private_folder


@pytest.fixture(autouse=True)
def unsaid(monkeypatch: pytest.MonkeyPatch) -> None:
    """What is noted here about folders is not for the commands that later tests run in this process."""
    monkeypatch.setattr(user_folder, "notes", [])


def test_a_folder_is_made_this_users_alone(tmp_path: Path) -> None:
    (tmp_path / "open").mkdir()
    (tmp_path / "open").chmod(0o777)
    for name in ("open", "new", "above/new", "two/are/missing"):
        assert private_folder(tmp_path / name) == tmp_path / name
        assert stat.S_IMODE((tmp_path / name).stat().st_mode) == 0o700


def test_a_folder_that_is_another_users_or_behind_anothers_link_is_not_used(tmp_path: Path) -> None:
    (tmp_path / "folder").mkdir()
    (tmp_path / "file").touch()
    (tmp_path / "link").symlink_to(tmp_path / "folder")
    assert private_folder(tmp_path / "file") is None
    assert len(user_folder.notes) == 1
    assert private_folder(tmp_path / "link") == tmp_path / "link"  # one's own, to another disk say
    if os.geteuid() == 0:
        os.chown(tmp_path / "link", 54321, 54321, follow_symlinks=False)
        assert private_folder(tmp_path / "link") is None
        (tmp_path / "mine").symlink_to(tmp_path / "folder")
        os.chown(tmp_path / "folder", 54321, 54321)
        assert private_folder(tmp_path / "folder") is private_folder(tmp_path / "mine") is None
