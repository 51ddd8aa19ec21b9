"""Which judge takes which set."""

from __future__ import annotations

from benchmarks.measured_sets import bar, plain, sizes, strengths
from benchmarks.measured_sets.values import Judge

PLAIN: Judge = plain.judge
JUDGES: dict[str, Judge] = {
    "pyrfda-steel-bar": bar.judge,
    "glockenspiel-fluidr3": sizes.judge,
    "xylophone-vcsl": sizes.judge,
    "agogo-forzee": strengths.judge,
    "ride-bja": strengths.judge,
}
