"""Names of cached results: sha256(numbers, options, source text that computes it)."""

from __future__ import annotations

import hashlib
from contextlib import suppress
from functools import cache, lru_cache
from importlib.metadata import PackageNotFoundError, version
from pathlib import Path

import numpy as np

from sonic_bullet.records import Array


@lru_cache(maxsize=4)
def code_digest(files: tuple[Path, ...], packages: tuple[str, ...]) -> bytes:
    """Digest what computes a result: source files and the versions of packages."""
    digest = hashlib.sha256()
    for file in files:
        digest.update(file.read_bytes())
    for name in packages:
        with suppress(PackageNotFoundError):
            digest.update(f"{name} {version(name)}".encode())
    return digest.digest()


def _code() -> bytes:
    """Digest all that turns a surface into modes: this package, `geometry`, and the solvers' versions."""
    solvers = ("numpy", "scipy", "scikit-fem", "netgen-mesher", "manifold3d")
    return code_digest(_sources(), solvers)


@cache
def _sources() -> tuple[Path, ...]:
    here = Path(__file__).resolve().parent
    return (*sorted(here.rglob("*.py")), *sorted((here.parent / "geometry").glob("*.py")))


def key(kind: str, *parts: Array | str | float | int | None, code: bytes | None = None) -> str:
    """Name a result by ``kind`` and a digest of parts and code.

    Arrays count by dtype, shape and bytes. The code is by default that of this package.
    """
    digest = hashlib.sha256(_code() if code is None else code)
    for part in parts:
        if isinstance(part, np.ndarray):
            digest.update(f"{part.dtype.str}{part.shape}".encode())
            digest.update(np.ascontiguousarray(part).data)
        else:
            digest.update(repr(part).encode())
        digest.update(b"\0")
    return f"{kind}-{digest.hexdigest()}"
