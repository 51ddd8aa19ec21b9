"""Options of a body's modes, checked when built: how many, where clamped, and the wall thickness."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

from sonic_bullet.records.arrays import store
from sonic_bullet.records.coerce import as_flag, as_number, as_rows, as_whole
from sonic_bullet.records.errors import MeshError, ModalError


@dataclass(frozen=True, slots=True)
class ModalOptions:
    """Options of a body's modes.

    Parameters
    ----------
    to_hz, count
        Modes up to that frequency, or the lowest ``count``.
    fixed
        Clamped spheres (x, y, z, radius) in m, body frame.
    thickness_m
        Wall of open surfaces.
    accuracy
        Relative, of the highest frequency. None: as it comes, its error untold, in two thirds of the time.
    tail
        Whether a plate or shell has resonators above its last mode, up to to_hz.
    draft
        Few modes, of coarse elements, at once.

    Raises
    ------
    ModalError
        to_hz, count, fixed or accuracy is wrong.
    MeshError
        thickness_m is wrong.
    """

    to_hz: float = 20_000.0
    count: int | None = None
    fixed: Sequence[Sequence[float]] = ()
    thickness_m: float | None = None
    accuracy: float | None = 0.01
    tail: bool = False
    draft: bool = False

    def __post_init__(self) -> None:
        """Check the fields."""
        most_asked = 2000
        thickest_m = 1e4
        highest_hz = 1e9
        remedy = "give clamps as [(x, y, z, radius), …] in metres, body frame"
        fixed = as_rows(self.fixed, "fixed", 4, remedy, error=ModalError)
        for number, row in enumerate(fixed):
            as_number(row[3], f"the radius of fixed[{number}]", remedy, least=0, error=ModalError)
        store(
            self,
            to_hz=as_number(
                self.to_hz, "to_hz", "give a frequency above zero, in Hz", above=0, most=highest_hz, error=ModalError
            ),
            fixed=fixed,
            tail=as_flag(self.tail, "tail"),
            draft=as_flag(self.draft, "draft"),
        )
        if self.accuracy is not None:
            remedy = "give a part of a frequency, such as 0.01"
            store(self, accuracy=as_number(self.accuracy, "accuracy", remedy, above=0, most=0.5, error=ModalError))
        if self.count is not None:
            store(
                self,
                count=as_whole(
                    self.count, "count", f"ask for 1 to {most_asked} modes", least=1, most=most_asked, error=ModalError
                ),
            )
        if self.thickness_m is not None:
            wall = as_number(
                self.thickness_m,
                "thickness_m",
                "give a wall thickness above zero, in m",
                above=0,
                most=thickest_m,
                error=MeshError,
            )
            store(self, thickness_m=wall)
