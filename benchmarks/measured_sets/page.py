"""Outcomes -> a page of markdown and a figure a set."""

from __future__ import annotations

import re
import textwrap
from dataclasses import dataclass
from pathlib import Path
from typing import Any

from benchmarks.measured_sets.observed import JITTER, READINGS
from benchmarks.measured_sets.values import ACCEPTED_BELOW, CHANCE, DRAWS, Outcome, Row

MOST_WORDS, COLUMNS = 40, 150
BAR = "\\|"  # inside a table's cell
HEAD = f"""# Measured data: fitted on one part, judged on another

Written by `python benchmarks/measured.py --data ../shared/measured`. \
Recordings and resonances by others, read where they lie.
Numbers and drawings stand here, no copy. Each set's source and licence stand under it.

**Before** is the baseline, **after** the baseline with one effect of `sonic_bullet.effects`.
Each is fitted on the one part and judged on the other, which it never saw.
**Null** is the median error of {DRAWS} effects of as many numbers that mean nothing (each set says which).
**Chance** is the share of them that do at least as well as the effect.
An effect is *named* where it takes the error on the held-out part below {ACCEPTED_BELOW:.0%} of the baseline's, \
and at most {CHANCE:.0%} of the null's draws do so.
Else the set's verdict is *unexplained*, and what is left is said.
Errors of decays are in dB of d (20 lg d'/d: 6 dB are a factor of two), medians over the lines held out.

Every set is read {READINGS} times: as it was recorded, and with every sample off by {JITTER:g} of itself, \
which is far below the last bit.
A rattling tap is no sum of a few decays, and a search for them may end elsewhere for as little \
(or on another processor).
So an effect is *named* only where it is in all readings. The range of *after* \
over them stands in brackets where they differ.
"""


@dataclass(frozen=True)
class Page:
    """One set: its README, its case.json, and what was found."""

    name: str
    readme: str
    case: dict[str, Any]
    found: Outcome

    @property
    def credit(self) -> str:
        source = _after(self.readme, "Source") or str(self.case.get("source", "not stated"))
        licence = _after(self.readme, "Licence") or str(self.case.get("licence", "not stated"))
        return f"Source: {source.strip().rstrip('.')}. Licence: {licence.strip().rstrip('.')}."


def _after(text: str, word: str) -> str:
    found = re.search(rf"\*\*{word}\.\*\*\s*(.+)", text)
    return found.group(1) if found else ""


def verdict(rows: tuple[Row, ...]) -> str:
    named = [f"`{r.effect}` ({r.what})" for r in rows if r.accepted]
    return f"named: {', '.join(named)}" if named else "unexplained"


def written(out: Path, pages: list[Page], skipped: list[str]) -> None:
    """The page at ``out``, figures in the folder `pictures` beside it."""
    place = out.parent / "pictures"
    place.mkdir(parents=True, exist_ok=True)
    parts = [HEAD, summary(pages)]
    for page in pages:
        _figure(page, place / f"{page.name}.png")
        parts.append(section(page, f"{place.name}/{page.name}.png"))
    if skipped:
        parts.append(
            f"## Skipped\n\n{len(skipped)} sets or files were not judged:\n\n"
            + "\n".join(f"- {line}" for line in skipped)
            + "\n"
        )
    out.write_text("\n".join(parts))


def summary(pages: list[Page]) -> str:
    rows = ["| set | verdict |", "|---|---|"] + [f"| [{p.name}](#{p.name}) | {verdict(p.found.rows)} |" for p in pages]
    return "\n".join(rows) + "\n"


def section(page: Page, figure: str) -> str:
    head = "| held out | items | unit | before | after | null | chance | effect |\n|---|---|---|---|---|---|---|---|"
    rows = [
        f"| {r.what} | {r.count} | {r.unit.replace('|', BAR)} | {r.before:.3g} | {_after_all(r)} | "
        f"{r.null:.3g} | {r.chance:.0%} | {r.effect or 'none proposed'}{_said(r)} |"
        for r in page.found.rows
    ]
    what = str(page.case.get("type") or page.case.get("object") or "")
    return "\n".join(
        [
            f"## {page.name}",
            "",
            prose(f"{what[:1].upper()}{what[1:]}. {page.credit}" if what else page.credit),
            "",
            f"![{page.name}]({figure})",
            "",
            head,
            *rows,
            "",
            prose(page.found.text),
            "",
            prose(f"Verdict: {verdict(page.found.rows)}. Left: {page.found.unexplained}."),
            "",
        ]
    )


def prose(text: str) -> str:
    """A paragraph in lines of at most COLUMNS; a sentence of more than MOST_WORDS ends at its semicolons."""
    sentences = re.split(r"(?<=[.!?])\s+(?=[^\sa-z])", text)
    parts = [part for s in sentences for part in (s.split("; ") if len(s.split()) > MOST_WORDS else [s])]
    short = [part if part.endswith((".", "!", "?")) else part + "." for part in parts]
    return "\n".join(
        textwrap.wrap(
            " ".join(part[:1].upper() + part[1:] for part in short),
            COLUMNS,
            break_long_words=False,
            break_on_hyphens=False,
        )
    )


def _after_all(r: Row) -> str:
    """The error after, and its range over all readings where they differ."""
    told = [f"{x.after:.3g}" for x in (r, *r.again) if x is not None]
    ends = sorted(told, key=float)
    spread = [f"{ends[0]} to {ends[-1]}"] if ends[0] != ends[-1] else []
    gone = [f"none in {r.again.count(None)}"] if None in r.again else []
    return f"{told[0]} ({', '.join(spread + gone)})" if spread or gone else told[0]


def _said(r: Row) -> str:
    if r.accepted:
        return " **accepted**"
    times = sum(x is not None and x.accepted_here for x in (r, *r.again))
    return f" (accepted in {times} of {1 + len(r.again)} readings)" if times else ""


def _figure(page: Page, path: Path) -> None:
    from matplotlib.backends.backend_agg import FigureCanvasAgg
    from matplotlib.figure import Figure

    figure = Figure(figsize=(5.0, 2.8), dpi=100, layout="constrained")
    FigureCanvasAgg(figure)
    page.found.draw(figure)
    for axes in figure.axes:
        axes.tick_params(labelsize=7)
        axes.xaxis.label.set_fontsize(8)
        axes.yaxis.label.set_fontsize(8)
    figure.savefig(path, metadata={"Software": None})
