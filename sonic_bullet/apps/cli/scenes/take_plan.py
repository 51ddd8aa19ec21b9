"""Options of `render --takes N`: what a log does not determine, drawn anew; and values set by hand.

TakeOptions -> TakePlan, checked -> log with --roughness and --gain -> take 1 … N (session/variation.py)
    -> NAME-01.wav … and a page of players
"""

from __future__ import annotations

import math
from collections.abc import Collection, Mapping
from dataclasses import dataclass, field
from pathlib import Path
from typing import TYPE_CHECKING

from sonic_bullet.options.render import TakeOptions
from sonic_bullet.records.errors import FileError

if TYPE_CHECKING:
    from sonic_bullet.files import ContactLog
    from sonic_bullet.session.variation import LogTake, Variation


@dataclass(frozen=True, slots=True)
class TakePlan:
    """What takes are to be. roughness_m: by names, "" all others."""

    takes: int | None = None
    take: int | None = None
    varied: frozenset[str] | None = None  # None: all
    footprint_m: float | None = None
    roughness_m: Mapping[str, float] = field(default_factory=dict)
    gain_db: Mapping[str, float] = field(default_factory=dict)
    page: str | None = None

    @classmethod
    def read(cls, options: TakeOptions) -> TakePlan:
        """Read the options; FileError where they contradict each other."""
        takes, take, vary, footprint_mm = options.takes, options.take, options.vary, options.footprint_mm
        page = options.page
        if takes is None and take is None:
            for option, given in (("--vary", vary), ("--footprint", footprint_mm)):
                if given is not None:
                    raise FileError(f"{option} says how takes differ, and none is asked for", "give --takes N too")
        if takes is not None and take is not None:
            raise FileError("--takes writes all takes, --take one", "give one of both")
        if page is not None and Path(page).suffix.lower() not in (".html", ".htm"):
            raise FileError(f"cannot write {page}: a page is HTML", "end the name with .html")
        varied = None if vary is None else frozenset(part.strip() for part in vary.split(","))
        if varied is not None:
            from sonic_bullet.session.variation import VARIED

            for one in sorted(varied - set(VARIED)):
                raise FileError(f"--vary {one}: takes do not differ in that", f"give some of {','.join(VARIED)}")
        rough = read_numbers(options.roughness, "--roughness", least=0, most=1e4, all_bodies=True)
        return cls(
            takes,
            take,
            varied,
            None if footprint_mm is None else footprint_mm * 1e-3,
            {name: um * 1e-6 for name, um in rough.items()},
            read_numbers(options.gain, "--gain", least=-200, most=200, all_bodies=False),
            page,
        )

    def __bool__(self) -> bool:
        """Tell whether any is given."""
        return bool(self.takes or self.take or self.roughness_m or self.gain_db)

    @property
    def variation(self) -> Variation:
        """Variation for `make_take`."""
        from sonic_bullet.session.variation import VARIED, Variation

        return Variation(frozenset(VARIED) if self.varied is None else self.varied, self.footprint_m)

    def apply_to(self, log: ContactLog, where: str) -> ContactLog:
        """Return the log with roughness and gains set; raises SceneError."""
        from sonic_bullet.session.variation import with_gains, with_roughness

        log = with_roughness(log, self.roughness_m, where) if self.roughness_m else log
        return with_gains(log, self.gain_db, where) if self.gain_db else log

    def change_log(self, log: ContactLog, where: str) -> tuple[ContactLog, tuple[str, ...]]:
        """Return the log to be rendered as one sound, and notes for the user."""
        from sonic_bullet.session.variation import AS_SIMULATED, make_take

        log = self.apply_to(log, where)
        if self.take is None:
            return log, ()
        take = make_take(log, self.take, self.variation)
        return take.log, (f"take {self.take}: {describe_draws(take) or 'the log itself'}; {AS_SIMULATED}",)

    def outputs(self, output: str) -> list[str]:
        """Return the names of all takes."""
        count, name = self.takes or 1, Path(output)
        digits = max(2, len(str(count)))
        return [str(name.with_name(f"{name.stem}-{k:0{digits}d}{name.suffix}")) for k in range(1, count + 1)]


def describe_draws(take: LogTake) -> str:
    """Format the factors of a take's materials in one line; empty where none was drawn."""
    words = {"youngs_pa": "E", "density_kg_m3": "ρ", "loss_factor": "η", "roughness_m": "roughness"}
    return "; ".join(
        f"{name} " + ", ".join(f"{words.get(key, key)} × {factor:.3g}" for key, factor in factors.items())
        for name, factors in take.drawn.items()
    )


def read_numbers(
    given: Collection[str], option: str, *, least: float, most: float, all_bodies: bool
) -> dict[str, float]:
    """Return numbers by body of NAME=X, and under "" of a plain X for all bodies.

    Raises FileError where one is not valid, or given twice.
    """
    found: dict[str, float] = {}
    for text in given:
        name, equals, number = text.rpartition("=")
        try:
            value = float(number)
        except ValueError:
            value = math.nan
        if not least <= value <= most or bool(equals) != bool(name.strip()) or not (equals or all_bodies):
            form = "[NAME=]NUMBER" if all_bodies else "NAME=NUMBER"
            raise FileError(f"{option} {text[:80]} is no {form}", f"give a number from {least:g} to {most:g}")
        if name in found:
            raise FileError(f"{option} names {name or 'all bodies'} twice", "give it once")
        found[name] = value
    return found
