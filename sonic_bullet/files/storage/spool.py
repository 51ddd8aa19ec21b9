"""Tables that grow for hours: in memory while they are small, then in a temporary file without a name.

    append -> fresh rows -> spill -> packed bytes (memory up to `memory_bytes`, then the file) -> [start:stop]

The file is unlinked from the start (`tempfile.TemporaryFile`): nothing is left, however the process ends. It is in
TMPDIR, else in /tmp. Rows are read by pread(2) on its descriptor, so that a reader moves no writer. Another thread may
read during an append. A forked process continues in a file of its own.
"""

from __future__ import annotations

import os
import tempfile
import threading
from typing import IO, Any

import numpy as np

from sonic_bullet.files.storage.atomic import cannot
from sonic_bullet.records import Array
from sonic_bullet.records.errors import FileError

MEMORY_BYTES = 4 << 20
"""Memory of one spool: 5 s of a small scene's contacts, 10 s of one channel at 48 kHz touch no disk."""
BLOCK_BYTES = 1 << 18
"""Bytes written at once: a write call costs microseconds, negligible once in 1000 steps."""


class Spool:
    """Rows of one dtype and shape, appended in order and read back by [start:stop], read-only.

    Parameters
    ----------
    dtype, tail
        Dtype and shape of a row.
    what
        Name of the content for the message of a full disk ("contact log").
    instead
        What the user can do without a larger disk ("attach with keep_log=False").
    memory_bytes
        Limit of the memory.
    """

    def __init__(
        self,
        dtype: Any,
        tail: tuple[int, ...] = (),
        *,
        what: str,
        instead: str = "",
        memory_bytes: int | None = None,
    ) -> None:
        self.dtype, self.tail, self.what, self.instead = np.dtype(dtype), tail, what, instead
        self.row_bytes = self.dtype.itemsize * int(np.prod(tail))
        self._memory_bytes = MEMORY_BYTES if memory_bytes is None else memory_bytes
        self._memory = bytearray()
        self._file: IO[bytes] | None = None
        self._fresh: list[Array] = []
        self._packed = self._count = 0
        self._block = max(1, BLOCK_BYTES // max(self.row_bytes, 1))
        self._lock, self._process = threading.RLock(), os.getpid()

    def __len__(self) -> int:
        """Return the number of rows."""
        return self._count

    @property
    def on_disk(self) -> bool:
        """Whether its rows have outgrown the memory."""
        return self._file is not None

    def append(self, rows: Array) -> None:
        """Append rows (k, *tail) of the dtype, C-contiguous and no longer modified; `spill` writes them to disk."""
        with self._lock:
            self._fresh.append(rows)
            self._count += len(rows)

    def spill(self) -> None:
        """Pack the fresh rows, once they are many.

        Raises
        ------
        FileError
            The disk takes no more; the rows stay in memory and can still be read.
        """
        if self._count - self._packed >= self._block:
            with self._lock:
                self._pack()

    def _pack(self) -> None:
        raw = b"".join(self._fresh)  # type: ignore[arg-type]
        if self._file is None and len(self._memory) + len(raw) <= self._memory_bytes:
            self._memory += raw
        else:
            try:
                if self._file is None or self._process != os.getpid():
                    file = tempfile.TemporaryFile(prefix="sonic-bullet-", buffering=0)  # noqa: SIM115 - lives as we do
                    for start in range(0, self._packed, self._block):
                        _write(file, self._read(start, min(start + self._block, self._packed)), start * self.row_bytes)
                    self._file, self._memory, self._process = file, bytearray(), os.getpid()
                _write(self._file, raw, self._packed * self.row_bytes)
            except OSError as error:
                self._fresh = [self._rows(raw)]
                raise self._refusal_error(error) from error
        self._packed, self._fresh = self._count, []

    def _rows(self, raw: bytes) -> Array:
        return np.frombuffer(raw, self.dtype).reshape(len(raw) // max(self.row_bytes, 1), *self.tail)

    def _refusal_error(self, error: OSError) -> FileError:
        """Make the error of a refused write, with a remedy."""
        if self._file is not None:
            os.ftruncate(self._file.fileno(), self._packed * self.row_bytes)  # frees a partial write
        said = cannot("keep more of the", self.what, error)
        larger = "set TMPDIR to a folder with more room"
        place = tempfile.tempdir or "the temporary folder"
        return FileError(f"{said.what} ({place})", f"{larger}, or {self.instead}" if self.instead else larger)

    def __getitem__(self, rows: slice) -> Array:
        """Read rows start … stop-1 as a new array; raises FileError."""
        with self._lock:
            start, stop, _ = rows.indices(self._count)
            stop = max(start, stop)
            parts = []
            if start < self._packed:
                parts.append(self._read(start, min(stop, self._packed)))
            if stop > self._packed:
                fresh = b"".join(self._fresh)  # type: ignore[arg-type]
                self._fresh = [self._rows(fresh)]
                first = max(start - self._packed, 0) * self.row_bytes
                parts.append(fresh[first : (stop - self._packed) * self.row_bytes])
        raw = parts[0] if len(parts) == 1 else b"".join(parts)
        return np.frombuffer(raw, self.dtype).reshape(stop - start, *self.tail)

    def _read(self, start: int, stop: int) -> bytes:
        at, count = start * self.row_bytes, (stop - start) * self.row_bytes
        if self._file is None:
            return bytes(self._memory[at : at + count])
        return read_at(self._file.fileno(), count, at, self.what)


def _write(file: IO[bytes], data: bytes | bytearray, at: int = 0) -> None:
    """Write all of ``data`` at byte ``at``; raises OSError."""
    file.seek(at)
    left = memoryview(data)
    while left:
        left = left[file.write(left) :]


def read_at(fd: int, count: int, at: int, what: object) -> bytes:
    """Read ``count`` bytes from byte ``at`` of an open file; FileError where it was cut."""
    parts = []
    try:
        while count:
            part = os.pread(fd, min(count, 1 << 30), at)  # Linux reads at most 2 GiB at once
            if not part:
                raise FileError(f"cannot read {what}: it was cut while it was in use", "make it again")
            parts.append(part)
            count, at = count - len(part), at + len(part)
    except OSError as error:
        raise cannot("read", what, error) from error
    return parts[0] if len(parts) == 1 else b"".join(parts)
