"""Errors a user can act on: each message names the thing and the remedy in one line.

The command line prints ``str(error)`` behind the program's name and exits with 2; a library user catches
`SonicBulletError` or one of its kinds. Nothing else is raised on purpose.
"""

from __future__ import annotations

from collections.abc import Iterator
from contextlib import contextmanager


class SonicBulletError(Exception):
    """Base of all errors raised on purpose: ``what`` is wrong, and the ``remedy``.

    Both are single lines; ``str(error)`` is ``"what; remedy"``.
    """

    def __init__(self, what: str, remedy: str = "") -> None:
        self.what = " ".join(what.split())
        self.remedy = " ".join(remedy.split())
        super().__init__(f"{self.what}; {self.remedy}" if self.remedy else self.what)


class RecordError(SonicBulletError):
    """A record's invariant does not hold (shape, sign, finiteness, normalisation)."""


class MaterialError(SonicBulletError):
    """A material or preset is unknown, unreadable or unphysical."""


class MeshError(SonicBulletError):
    """A mesh cannot be read, closed or filled with tetrahedra."""


class ModalError(SonicBulletError):
    """The eigenvalue problem has no usable answer for this body."""


class SceneError(SonicBulletError):
    """The PyBullet world or the scene script is not usable (NaN mass, removed body, lost connection)."""


class LogError(SonicBulletError):
    """A contact log is cut, foreign or inconsistent."""


class AudioError(SonicBulletError):
    """Sample rate, samples or level that cannot be written or synthesised."""


class FileError(SonicBulletError):
    """A path cannot be read or written."""


@contextmanager
def interrupts() -> Iterator[None]:
    """An interrupt that meets compiled code on its way out arrives as SystemError, caused by it: here it is a KeyboardInterrupt again, with whatever was noted."""
    try:
        yield
    except SystemError as error:
        if not isinstance(error.__cause__, KeyboardInterrupt):
            raise
        raise KeyboardInterrupt("; ".join([str(error.__cause__) or "stopped", *getattr(error, "__notes__", [])])) from error
