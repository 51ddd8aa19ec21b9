"""A command called in the tests' own process, which has its imports behind it, as if from a shell in some folder."""

from __future__ import annotations

import os
import subprocess
import sys
import tempfile
from collections.abc import Iterator
from contextlib import chdir, contextmanager
from pathlib import Path
from typing import IO

import pytest

from sonic_bullet.apps.cli import main


@contextmanager
def _caught(number: int, name: str) -> Iterator[IO[bytes]]:
    """What is written to a file descriptor, by Python or by a C library."""
    with tempfile.TemporaryFile() as file, pytest.MonkeyPatch.context() as patch:
        kept = os.dup(number)
        os.dup2(file.fileno(), number)
        with open(os.dup(number), "w", encoding="utf-8", buffering=1) as stream:
            patch.setattr(sys, name, stream)
            try:
                yield file
            finally:
                stream.flush()
                os.dup2(kept, number)
                os.close(kept)


def call_here(folder: Path, *words: str | bytes) -> subprocess.CompletedProcess[str]:
    """Exit code and output of `sonic-bullet` with these words."""
    with _caught(1, "stdout") as out, _caught(2, "stderr") as err, pytest.MonkeyPatch.context() as patch:
        patch.setattr(sys, "argv", ["sonic-bullet", *map(os.fsdecode, words)])
        with chdir(folder), pytest.raises(SystemExit) as ended:
            main()
        sys.stdout.flush()
        sys.stderr.flush()
        told = []
        for file in (out, err):
            file.seek(0)
            told.append(file.read().decode(errors="replace"))
    return subprocess.CompletedProcess(words, int(ended.value.code or 0), *told)
