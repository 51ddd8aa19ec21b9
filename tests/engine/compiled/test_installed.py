"""What is installed is whole: the tests of this folder run from a wheel, too (`tools/installed_tests.py`)."""

from __future__ import annotations

from pathlib import Path

import sonic_bullet
from sonic_bullet import _engine

REPO = Path(__file__).resolve().parents[3]


def test_all_files_of_the_package_are_there() -> None:
    """Materials, notices, page templates and the mark of types come with the modules."""
    source, installed = REPO / "sonic_bullet", Path(sonic_bullet.__file__).parent
    wanted = {path.relative_to(source) for path in source.rglob("*") if path.is_file()}
    wanted = {path for path in wanted if "__pycache__" not in path.parts}
    missing = [str(path) for path in sorted(wanted) if not (installed / path).is_file()]
    assert not missing
    assert {".json", ".jinja", ".typed", ".txt", ".pyi"} <= {path.suffix for path in wanted}


def test_the_engine_is_compiled() -> None:
    assert Path(_engine.__file__).suffix in {".so", ".pyd"}
