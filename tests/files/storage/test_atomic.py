"""Under a name there is the old file or the whole new one: on a disk that fills up, and after a kill; what a killed run
leaves is swept.
"""

from __future__ import annotations

import json
import os
import subprocess
import sys
import threading
from collections.abc import Callable
from pathlib import Path
from typing import Any

import numpy as np
import pytest
import soundfile

from sonic_bullet.files import read_audio, replace_file, write_audio
from sonic_bullet.files.presets import named_preset, write_preset
from sonic_bullet.files.storage import cache
from sonic_bullet.files.storage.atomic import PARTIAL_NAME, PartialFile
from sonic_bullet.records.errors import FileError
from sonic_bullet.records.file_endings import AUDIO_FORMATS

REPO = Path(__file__).resolve().parents[3]
SR = 48_000
SOUND = 0.3 * np.sin(np.arange(9600) * [[0.1], [0.2]])
ORPHAN = ".sonic-bullet-0123456789abcdef.partial"

WRITERS: dict[str, Callable[[Path], Any]] = {
    "audio": lambda folder: write_audio(folder / "a.flac", SOUND, SR),
    "preset": lambda folder: write_preset(folder / "a.json", named_preset("steel")),
    "cache": lambda folder: cache.save(folder, "modes-0", {"shape": np.zeros(3)}, ""),
}


def names(folder: Path) -> set[str]:
    return {path.name for path in folder.iterdir()}


def study(name: str, *words: str) -> Any:
    done = subprocess.run(
        [sys.executable, REPO / "studies" / f"{name}.py", "--json", *words],
        check=False,
        capture_output=True,
        text=True,
        timeout=280,
    )
    assert done.stdout, done.stderr
    found = json.loads(done.stdout)
    if "skipped" not in found:
        assert done.returncode == 0, done.stdout + done.stderr
    return found


# ---- full disks


def test_a_disk_that_fills_up_never_ends_with_exit_0_and_a_bad_file() -> None:
    """The benchmark has every format at 40 fill levels; here are the compressed ones, whose last bytes are written at
    close, and an npz.
    """
    found = study("full_disk", "--levels", "8", "--kinds", ".flac,.ogg,.wav,.npz,preset")
    if "skipped" in found:
        pytest.skip(f"no small disk can be mounted here: {found['skipped']} fill levels not tried")
    assert [counts["levels"] for counts in found.values()] == [8] * 5
    assert all(
        counts["whole"] + counts["refused"] == 8 and not counts["bad"] and counts["refused"] >= 2
        for counts in found.values()
    ), found


LIMITED = """
import resource, sys, numpy as np
from sonic_bullet import files
from sonic_bullet.records import errors
sound = 0.3 * np.sin(np.arange(9600) * [[0.1], [0.2]])
for name in sys.argv[1:]:
    files.write_audio(name, sound, 48000)
    import os
    size = os.path.getsize(name)
    for limit in [size * k // 5 for k in range(5)] + [size - 4096, size - 1000, size - 1]:
        os.unlink(name)
        soft, hard = resource.getrlimit(resource.RLIMIT_FSIZE)
        resource.setrlimit(resource.RLIMIT_FSIZE, (max(limit, 1), hard))
        try:
            files.write_audio(name, sound, 48000)
        except errors.FileError as error:
            said = str(error)
        else:
            said = ""
        finally:
            resource.setrlimit(resource.RLIMIT_FSIZE, (soft, hard))
        if said:
            assert not os.path.exists(name) and "File too large" in said, (name, limit, said)
            open(name, "w").close()
        else:
            assert files.read_audio(name)[0].shape == (2, 9600), (name, limit)
        print(name, limit, bool(said))
"""


def test_a_file_that_may_not_grow_is_refused_at_every_size_in_every_format(tmp_path: Path) -> None:
    """RLIMIT_FSIZE stands for a full disk where none can be mounted."""
    wanted = [f"a{extension}" for extension in AUDIO_FORMATS]
    done = subprocess.run(
        [sys.executable, "-c", LIMITED, *wanted], cwd=tmp_path, check=False, capture_output=True, text=True, timeout=250
    )
    assert done.returncode == 0, done.stderr
    lines = done.stdout.splitlines()
    assert len(lines) == 8 * len(wanted)
    assert sum(line.endswith("True") for line in lines) >= 6 * len(wanted)
    assert {name for name in names(tmp_path) if "sonic-bullet" in name} == set()


def test_what_libsndfile_loses_silently_is_seen_when_it_is_read_back(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    (tmp_path / "a.wav").write_bytes(b"old")
    real = soundfile.SoundFile.write
    monkeypatch.setattr(soundfile.SoundFile, "write", lambda self, data: real(self, data[:-1]))
    with pytest.raises(FileError, match="only a part"):
        write_audio(tmp_path / "a.wav", SOUND, SR)
    assert (tmp_path / "a.wav").read_bytes() == b"old"
    assert names(tmp_path) == {"a.wav"}


@pytest.mark.skipif(not os.path.exists("/dev/full"), reason="no /dev/full")
def test_a_full_disk_behind_stdout_is_no_success() -> None:
    with open("/dev/full", "w") as full:
        done = subprocess.run(
            [sys.executable, "-c", "from sonic_bullet.apps.cli import main; main()", "materials"],
            check=False, stdout=full, stderr=subprocess.PIPE, text=True, timeout=120,
        )  # fmt: skip
    assert done.returncode != 0
    assert "Traceback" not in done.stderr


# ---- what killed runs leave


@pytest.mark.parametrize("kind", WRITERS)
def test_the_next_writer_sweeps_what_a_killed_run_left(tmp_path: Path, kind: str) -> None:
    (tmp_path / ORPHAN).write_bytes(b"half")
    WRITERS[kind](tmp_path)
    left = names(tmp_path)
    assert len(left) == 1
    assert ORPHAN not in left


def test_a_file_whose_lock_is_held_is_not_swept(tmp_path: Path) -> None:
    held = PartialFile(tmp_path)
    os.write(held.fd, b"whole")
    for write in WRITERS.values():
        write(tmp_path)
    assert held.path.read_bytes() == b"whole"
    held.replace(tmp_path / "b")
    held.close()
    assert (tmp_path / "b").read_bytes() == b"whole"
    assert names(tmp_path) == {"a.flac", "a.json", "modes-0.npz", "b"}


def test_nothing_but_our_own_unfinished_files_is_swept(tmp_path: Path) -> None:
    kept = [
        "a.partial.wav", "sonic-bullet-0123.partial", "x" + ORPHAN, ORPHAN + ".txt", ORPHAN.upper(),
        "important.partial", "sonic-bullet-0123456789abcdeg.partial",
    ]  # fmt: skip
    for name in kept:
        (tmp_path / name).write_text("mine")
    (tmp_path / ORPHAN).mkdir()
    os.mkfifo(tmp_path / ORPHAN.replace("0", "1"))
    (tmp_path / ORPHAN.replace("0", "2")).symlink_to("important.partial")
    before = names(tmp_path)
    for write in WRITERS.values():
        write(tmp_path)
    assert names(tmp_path) == before | {"a.flac", "a.json", "modes-0.npz"}


def test_an_error_leaves_nothing(tmp_path: Path) -> None:
    with pytest.raises(ZeroDivisionError), replace_file(tmp_path / "a") as file:
        file.write(b"half")
        assert [bool(PARTIAL_NAME.fullmatch(name)) for name in names(tmp_path)] == [True]
        raise ZeroDivisionError
    assert names(tmp_path) == set()


def test_writers_that_sweep_each_other_lose_nothing(tmp_path: Path) -> None:
    """Creation and lock are two steps: between them every new file looks like a killed run's to the others."""
    failed: list[BaseException] = []

    def work(who: int) -> None:
        try:
            for i in range(150):
                with replace_file(tmp_path / f"{who}") as file:
                    file.write(b"%d" % i * 1000)
        except BaseException as error:
            failed.append(error)

    threads = [threading.Thread(target=work, args=(who,)) for who in range(8)]
    for thread in threads:
        thread.start()
    for thread in threads:
        thread.join()
    assert failed == []
    assert names(tmp_path) == {str(who) for who in range(8)}
    assert {path.read_bytes() for path in tmp_path.iterdir()} == {b"149" * 1000}


def test_kills_leave_the_old_file_or_the_new_and_the_next_run_leaves_nothing_else() -> None:
    """The benchmark has 300."""
    found = study("kills", "--kills", "12", "--kinds", ".flac,.ogg,cache")["all"]
    assert (found["kills"], found["whole"], found["litter"]) == (12, 12, 0)
    assert found["in a write"] >= 2  # they did hit


def test_a_name_as_long_as_the_disk_takes_is_written(tmp_path: Path) -> None:
    for name in ("x" * 251 + ".wav", "é" * 125 + ".wav"):
        write_audio(tmp_path / name, SOUND, SR)
        assert read_audio(tmp_path / name)[0].shape == SOUND.shape
        with pytest.raises(FileError, match="too long"):
            write_audio(tmp_path / ("xx" + name), SOUND, SR)
