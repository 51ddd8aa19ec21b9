"""One case of many, by value: any process, on any machine, gives the same bytes.

folder -> CaseFolder -> its files (read where the job starts, or is sent away) -> the command of one case -> CaseResult
"""

from __future__ import annotations

import hashlib
import io
import os
from collections.abc import Iterator, Mapping
from contextlib import chdir, redirect_stderr, redirect_stdout
from dataclasses import dataclass, replace
from pathlib import Path
from tempfile import TemporaryDirectory
from typing import Any

import click

from sonic_bullet.apps.cli.diagnose_command import run_diagnose
from sonic_bullet.apps.cli.fit_command import run_fit
from sonic_bullet.apps.jobs.job_processes import Failure
from sonic_bullet.files.cases import read_case
from sonic_bullet.machine.progress import ignore_progress, shown_by
from sonic_bullet.options.fit import DiagnoseOptions, FitOptions, ManyOptions
from sonic_bullet.records.errors import FileError, SonicBulletError

# files of one case in the folder of many
PRESET_FILE = "preset.json"
VALUES_FILE = "result.json"
WORDS_FILE = "summary.txt"


@dataclass(frozen=True, slots=True, eq=False)
class CaseFolder:
    """A case of many.

    Parameters
    ----------
    name
        Of its folder.
    folder
        Where it is on this machine.
    files
        Contents by path inside the folder, where they were read before; FileError's text: why they were not.
    """

    name: str
    folder: Path
    files: Mapping[str, bytes] | str | None = None

    def __reduce__(self) -> tuple[Any, ...]:
        """Send the files along: another machine has no such folder."""
        try:
            files: Mapping[str, bytes] | str = self.contents()
        except SonicBulletError as error:
            files = str(error)
        return CaseFolder, (self.name, self.folder, files)

    def contents(self) -> Mapping[str, bytes]:
        """Return what the case names, as far as it is there.

        Raises
        ------
        FileError
            It is no case, or a file cannot be read.
        """
        if isinstance(self.files, str):
            raise FileError(self.files)
        if self.files is not None:
            return self.files
        paths = {self.folder / "case.json", *_list_case_files(self.folder)}
        try:
            return {str(path.relative_to(self.folder)): path.read_bytes() for path in sorted(paths) if path.is_file()}
        except OSError as error:
            raise FileError(f"cannot read case {self.folder}: {error.strerror or error}", "check its files") from error


def _list_case_files(folder: Path) -> Iterator[Path]:
    """Yield the paths of meshes, recordings and forces that a case names; FileError where it is none."""
    case = read_case(folder)
    for thing in case.objects.values():
        if thing.mesh is not None:
            yield thing.mesh
    for strike in case.recordings:
        if strike.file is not None:
            yield strike.file
        if strike.force is not None:
            yield strike.force[0]


def digest(files: Mapping[str, bytes]) -> str:
    """Return the SHA-256 of files with their names."""
    found = hashlib.sha256()
    for name, content in sorted(files.items()):
        found.update(f"{len(name)} {name} {len(content)} ".encode("utf-8", "surrogateescape") + content)
    return found.hexdigest()


@dataclass(frozen=True, slots=True, eq=False)
class CaseResult:
    """What a command made of a case. files: contents by name; case_sha256: of what it was made of."""

    files: Mapping[str, bytes]
    case_sha256: str


def run_case(options: FitOptions | DiagnoseOptions, case: CaseFolder) -> CaseResult | Failure:
    """Run a command of one case on its files, in a folder of its own.

    Parameters
    ----------
    options
        Of that command; those that name outputs hold names in the case's folder of results.
    """
    files = case.contents()
    with TemporaryDirectory(prefix="sonic_bullet_") as place:
        root, out = Path(place, "case", case.name), Path(place, "made")
        for name, content in files.items():
            (root / name).parent.mkdir(parents=True, exist_ok=True)
            (root / name).write_bytes(content)
        out.mkdir()
        root.mkdir(parents=True, exist_ok=True)
        said, warned = io.StringIO(), io.StringIO()
        try:
            # warnings and reports name files as they are named from here
            with chdir(root.parent), redirect_stdout(said), redirect_stderr(warned), shown_by(ignore_progress):
                _run(case.name, out, options)
        except click.exceptions.Exit:
            pass  # farther from the recordings than silence: its verdict says so
        except SonicBulletError as error:
            return Failure(str(error).replace(place + os.sep, ""))
        words = (said.getvalue() + warned.getvalue()).replace(place + os.sep, "")
        (out / WORDS_FILE).write_text(words, encoding="utf-8")
        made = {str(path.relative_to(out)): path.read_bytes() for path in sorted(out.rglob("*")) if path.is_file()}
    return CaseResult(made, digest(files))


def _run(source: str, out: Path, options: FitOptions | DiagnoseOptions) -> None:
    names = ("picture", "page", "csv_to", "uff_to", "predict", "report")
    to: dict[str, Any] = {
        name: str(out / given) for name in names if (given := getattr(options, name, None)) is not None
    }
    to |= {"output": str(out / PRESET_FILE), "json_to": str(out / VALUES_FILE)}
    asked = replace(options, **to, many=ManyOptions())
    if isinstance(asked, FitOptions):
        run_fit(source, asked)
    else:
        run_diagnose(source, asked)
