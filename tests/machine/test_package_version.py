"""Versions are found whatever a distribution is called, and what has none is no error."""

from __future__ import annotations

import sys
from importlib import metadata
from pathlib import Path

import pytest

from sonic_bullet.machine.package_version import find_version


def test_what_a_module_says_itself_comes_first() -> None:
    import numpy as np

    import sonic_bullet as sb

    assert find_version("numpy") == np.__version__ == metadata.version("numpy")
    assert find_version("sonic_bullet") == sb.__version__  # in a checkout that nobody installed, too


@pytest.mark.parametrize(
    ("distribution", "said"),
    [("silent-one", "3.2.8"), ("fork-arm64", "3.2.8 (fork-arm64)"), (None, "unknown")],
)
def test_a_fork_is_found_by_what_it_provides(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch, distribution: str | None, said: str
) -> None:
    name = "silent_one"
    (tmp_path / f"{name}.py").write_text("value = 1\n")
    if distribution is not None:
        facts = tmp_path / f"{distribution.replace('-', '_')}-3.2.8.dist-info"
        facts.mkdir()
        (facts / "METADATA").write_text(f"Metadata-Version: 2.1\nName: {distribution}\nVersion: 3.2.8\n")
        (facts / "top_level.txt").write_text(f"{name}\n")
    monkeypatch.syspath_prepend(tmp_path)
    find_version.cache_clear()
    assert find_version(name) == said
    sys.modules.pop(name)
    find_version.cache_clear()


def test_pybullet_has_a_version() -> None:
    pytest.importorskip("pybullet")
    assert find_version("pybullet").startswith("3.2.")
