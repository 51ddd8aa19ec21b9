"""Errors that a user can act on: each message states the fault and the remedy in one line.

The command line prints ``str(error)`` after the program's name and exits with 2; a library user catches
`SonicBulletError` or one of its subclasses. Nothing else is raised on purpose.
"""

from __future__ import annotations

from collections.abc import Iterator
from contextlib import contextmanager


class SonicBulletError(Exception):
    """Base of all errors raised on purpose: ``what`` is wrong, and the ``remedy``.

    Both are single lines; ``str(error)`` is ``"what; remedy"``, at most 990 bytes in UTF-8: a longer text
    loses its middle.
    """

    def __init__(self, what: str, remedy: str = "") -> None:
        remedy_bytes = 350  # of those, where both parts are long
        what, remedy = " ".join(what.split()), " ".join(remedy.split())
        message_bytes = 990  # of a whole message: names and files may hold megabytes, a terminal does not
        spare = message_bytes - 2 - len(_encode_text(what))
        self.remedy = _cut_text(remedy, max(spare, remedy_bytes))
        self.what = _cut_text(what, message_bytes - 2 - len(_encode_text(self.remedy)))
        super().__init__(f"{self.what}; {self.remedy}" if self.remedy else self.what)


def exception_words(error: BaseException) -> str:
    """Return class and message of any exception without a full stop, as the remedy follows."""
    words = f"{type(error).__name__}: {error}".rstrip()
    return words if words.endswith("..") else words.removesuffix(".")


def excerpt(text: str, most: int) -> str:
    """Return ``text``, or its start and end where it has more than ``most`` characters."""
    return text if len(text) <= most else f"{text[: 2 * most // 3]} … {text[len(text) - (most // 3 - 3) :]}"


def _cut_text(text: str, most_bytes: int) -> str:
    most = len(text)
    while len(_encode_text(short := excerpt(text, most))) > most_bytes:
        most = min(most, most_bytes) * 3 // 4 if most <= most_bytes else most_bytes
    return short


def _encode_text(text: str) -> bytes:
    return text.encode("utf-8", "replace")


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


class SceneWarning(UserWarning):
    """Part of a world is left out of its sound; issued once for each part."""


class AnimationError(SonicBulletError):
    """An animation cannot be read, or nothing in it could sound."""


class LogError(SonicBulletError):
    """A contact log is cut, foreign or inconsistent."""


class CompareError(SonicBulletError):
    """Two objects cannot be compared, or there is nothing to compare them with."""


class AudioError(SonicBulletError):
    """Sample rate, samples, level or sound card cannot be used for synthesis, writing or playback."""


class PlaybackWarning(UserWarning):
    """The sound card is gone: physics and log go on without playback; issued once."""


class MaterialWarning(UserWarning):
    """A material's numbers are those of no solid: another unit, most likely."""


class SizeWarning(UserWarning):
    """A body is larger than anything that is struck to sound: a mesh in millimetres, most likely."""


class DensityWarning(UserWarning):
    """A body's mass is not that of a solid of its material: another unit, or a default that nobody changed."""


class RestitutionWarning(UserWarning):
    """Bounces never end, by the settings of the engine."""


class CacheWarning(UserWarning):
    """Computed models cannot be kept: each run computes them anew."""


class FileError(SonicBulletError):
    """A path cannot be read or written."""


@contextmanager
def interrupts() -> Iterator[None]:
    """Restore a KeyboardInterrupt that compiled code turned into a SystemError, with its notes."""
    try:
        yield
    except SystemError as error:
        if not isinstance(error.__cause__, KeyboardInterrupt):
            raise
        raise KeyboardInterrupt(
            "; ".join([str(error.__cause__) or "stopped", *getattr(error, "__notes__", [])])
        ) from error
