"""Rows of measurements that are kept: what a file of JSON lines holds is not measured again."""

from __future__ import annotations

import json
from collections.abc import Callable, Iterable
from pathlib import Path
from typing import Any


def measure_missing(
    names: Iterable[str], measure: Callable[[str], dict[str, Any]], kept: Path | None
) -> dict[str, dict[str, Any]]:
    """Measure what the file has not, print and append each row; return all rows by their ``name``."""
    rows = {}
    if kept is not None and kept.exists():
        rows = {row["name"]: row for row in map(json.loads, kept.read_text().splitlines())}
    for name in names:
        if name not in rows:
            rows[name] = measure(name)
            print(json.dumps(rows[name]), flush=True)
            if kept is not None:
                kept.parent.mkdir(parents=True, exist_ok=True)
                with kept.open("a") as file:
                    file.write(json.dumps(rows[name]) + "\n")
    return rows
