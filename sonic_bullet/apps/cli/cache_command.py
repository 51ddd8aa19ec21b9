"""Command `cache`: list, bound or clear what is kept between runs."""

from __future__ import annotations

from dataclasses import dataclass
from datetime import datetime
from typing import TYPE_CHECKING, Any

import click

from sonic_bullet.apps.cli.output import clean_stdout, places, print_report, table, write_json
from sonic_bullet.options.cache import CacheOptions
from sonic_bullet.records.counts import format_count

if TYPE_CHECKING:
    from collections.abc import Iterable

    from sonic_bullet.files.storage.cache import KeptFile


def run_cache(options: CacheOptions) -> None:
    """Run `cache`; raises SonicBulletError."""
    from sonic_bullet.files.storage import cache as store

    clear, limit = options.clear, options.limit
    if clear and limit is not None:
        raise click.UsageError("--clear and --limit are both given: give one of them")
    (json_to,) = places(options.json_to)
    most_bytes = None if limit is None else store.as_bytes(limit, "--limit")
    allowed_bytes = store.limit_bytes()
    folder = store.folder("default")
    computed = [] if folder is None else store.list_models(folder)
    removed = store.evict_files(computed, 0) if clear else []
    if most_bytes is not None:
        removed = store.evict_files(computed, most_bytes)
    gone = {one.path for one in removed}
    left = [one for one in computed if one.path not in gone]
    result = {
        "folders": [] if folder is None else [str(folder)],
        "limit_bytes": allowed_bytes,
        "kinds": by_kind(left),
        "removed": by_kind(removed),
    }
    with clean_stdout(json_to) as echo:
        report = CacheReport(result, asked=clear or limit is not None)
        print_report(report, echo)
    write_json(json_to, report.to_json())


def by_kind(files: Iterable[KeptFile]) -> list[dict[str, Any]]:
    """Summarise each kind: number of files and bytes, and the last use of the one unused for longest."""
    kinds: dict[str, list[KeptFile]] = {}
    for one in files:
        kinds.setdefault(one.kind, []).append(one)
    return [
        {
            "kind": kind,
            "files": len(some),
            "bytes": sum(one.size_bytes for one in some),
            "oldest_use": datetime.fromtimestamp(min(one.used_s for one in some))
            .astimezone()
            .isoformat(" ", "minutes"),
        }
        for kind, some in sorted(kinds.items())
    ]


@dataclass(frozen=True, slots=True)
class CacheReport:
    """Report of what is cached. asked: a removal was asked for."""

    found: dict[str, Any]
    asked: bool

    def to_json(self) -> dict[str, Any]:
        """Return folders, limit, and each kind that is there or was removed."""
        return self.found

    def lines(self) -> list[str]:
        """Return folders, what was removed, and a table of the kinds."""

        def total_mb(kinds: list[dict[str, Any]]) -> float:
            return float(sum(kind["bytes"] for kind in kinds) / 1e6)

        lines = [f"kept in {' and '.join(self.found['folders'])}" if self.found["folders"] else "nothing can be kept"]
        if self.asked:
            count = sum(kind["files"] for kind in self.found["removed"])
            lines.append(f"removed: {format_count(count, 'file')}, {total_mb(self.found['removed']):.1f} MB")
        rows = [
            (kind["kind"], str(kind["files"]), f"{kind['bytes'] / 1e6:.1f}", kind["oldest_use"][:16])
            for kind in self.found["kinds"]
        ]
        if rows:
            lines.append(table(("kind", "files", "MB", "oldest use"), rows))
        limit = self.found["limit_bytes"] / 1e6
        return [*lines, f"{total_mb(self.found['kinds']):.1f} MB in all; of what is computed {limit:.0f} MB at most"]
