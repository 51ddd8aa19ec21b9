"""Build backend of the package: scikit-build-core, with a C++ compiler from the package index where there is none.

    a compiler (CXX, c++, g++, clang++, cl) -> scikit-build-core as it is
    none -> `ziglang` among what the build requires -> commands c++, ar, ranlib of one word each, as CMake wants them

pip calls the functions of PEP 517 and PEP 660 below; pyproject.toml names this file. Run as a program, it names what a
build requires on this machine.
"""

from __future__ import annotations

import os
import shutil
import stat
import sys
from collections.abc import Iterator
from contextlib import contextmanager, suppress
from pathlib import Path
from tempfile import TemporaryDirectory
from typing import Any

from scikit_build_core import build as scikit_build

Settings = dict[str, list[str] | str] | None

ZIG = "ziglang==0.15.1"
"""A release whose flags were tried: see CMakeLists.txt, which states what it must not take from the machine."""

SLOW = (
    "sonic_bullet: no C++ compiler was found, so one comes from the package index (ziglang): the build takes some "
    "minutes. With g++ or clang++ installed (Debian: apt install g++; macOS: xcode-select --install) it takes one."
)

build_sdist = scikit_build.build_sdist
get_requires_for_build_sdist = scikit_build.get_requires_for_build_sdist


def has_compiler() -> bool:
    """Test whether a C++ compiler is named by CXX or stands on PATH."""
    named = os.environ.get("CXX", "").split()
    return any(shutil.which(one) for one in (named[:1] or ["c++", "g++", "clang++", "cl", "clang-cl"]))


def get_requires_for_build_wheel(config_settings: Settings = None) -> list[str]:
    """Name what a wheel's build needs beside what pyproject.toml names."""
    return [*scikit_build.get_requires_for_build_wheel(config_settings), *([] if has_compiler() else [ZIG])]


get_requires_for_build_editable = get_requires_for_build_wheel


def build_wheel(directory: str, config_settings: Settings = None, metadata_directory: str | None = None) -> str:
    """Build a wheel into a directory; return its file's name."""
    with compiler():
        return str(scikit_build.build_wheel(directory, config_settings, metadata_directory))


def build_editable(directory: str, config_settings: Settings = None, metadata_directory: str | None = None) -> str:
    """Build an editable wheel into a directory; return its file's name."""
    with compiler():
        return str(scikit_build.build_editable(directory, config_settings, metadata_directory))


@contextmanager
def compiler() -> Iterator[None]:
    """Have CMake find a compiler meanwhile: the machine's, else ziglang's."""
    if has_compiler():
        yield
        return
    print(SLOW, file=sys.stderr)
    with suppress(OSError), open("/dev/tty", "w") as terminal:  # pip hides what a build says
        print(SLOW, file=terminal)
    with TemporaryDirectory() as folder:
        commands = {name: _command(Path(folder), name) for name in ("c++", "ar", "ranlib")}
        arguments = [f"-DCMAKE_CXX_COMPILER={commands['c++']}", f"-DCMAKE_AR={commands['ar']}"]
        arguments += [f"-DCMAKE_RANLIB={commands['ranlib']}", os.environ.get("CMAKE_ARGS", "")]
        before = dict(os.environ)
        os.environ["CMAKE_ARGS"] = " ".join(arguments).strip()
        try:
            yield
        finally:
            os.environ.clear()
            os.environ.update(before)


def _command(folder: Path, name: str) -> str:
    """Write a command that is one of zig's tools; return its path."""
    if os.name == "nt":
        path = folder / f"{name}.bat"
        path.write_text(f'@"{sys.executable}" -m ziglang {name} %*\n')
    else:
        path = folder / name
        path.write_text(f'#!/bin/sh\nexec "{sys.executable}" -m ziglang {name} "$@"\n')
        path.chmod(path.stat().st_mode | stat.S_IXUSR)
    return str(path)


def __getattr__(name: str) -> Any:
    """Offer scikit-build-core's other hooks, where it has any."""
    return getattr(scikit_build, name)


if __name__ == "__main__":  # for who builds in an environment of his own, where pip asks for nothing
    print(*get_requires_for_build_editable(), sep="\n")
