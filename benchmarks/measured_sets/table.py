"""Which judge takes which set."""

from __future__ import annotations

from benchmarks.measured_sets import bar, bell, crystals, fixtures, hammer, plain, repeats, sizes, strengths, tables
from benchmarks.measured_sets.values import Judge

PLAIN: Judge = plain.judge
JUDGES: dict[str, Judge] = {
    "pyrfda-steel-bar": bar.judge,
    "glockenspiel-fluidr3": sizes.judge,
    "xylophone-vcsl": sizes.judge,
    "agogo-forzee": strengths.judge,
    "ride-bja": strengths.judge,
    "diffimpact-hammer": hammer.judge,
    "hammer-frf-pyfrf": hammer.judge,
    "rus-crystals": crystals.judge,
    "diffimpact-robot": fixtures.judge,
    "wood-iet-timbr": repeats.judge,
    "bell-sonicpi": bell.judge,
    "tdw-material-modes": tables.materials,
    "tables-derived": tables.derived,
}
