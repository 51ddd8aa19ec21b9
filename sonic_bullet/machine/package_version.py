"""Version of an imported package, whatever the distribution is called that installed it.

PyBullet comes from PyPI's ``pybullet`` or from its fork ``pybullet-arm64``; a package may lie on the path without
having been installed at all. A version is recorded, never needed: an unknown one is "unknown", and no error.
"""

from __future__ import annotations

import importlib
from functools import cache
from importlib import metadata


@cache
def find_version(module: str) -> str:
    """Find the version of an importable top-level module.

    Parameters
    ----------
    module : str
        Name by which it is imported.

    Returns
    -------
    str
        ``__version__``; else that of the distribution of the same name; else that of another which provides the
        module, with its name: "3.2.8 (pybullet-arm64)"; else "unknown".
    """
    version = getattr(importlib.import_module(module), "__version__", None)
    if version is not None:
        return str(version)
    try:
        return metadata.version(module)
    except metadata.PackageNotFoundError:
        others = sorted(set(metadata.packages_distributions().get(module, ())))
        return ", ".join(f"{metadata.version(name)} ({name})" for name in others) or "unknown"
