"""Properties that a simulator reports of its bodies and of itself, by value.

    its own answers, and values that hooks see being set -> Values -> Body.dynamics, Simulator -> ContactLog

Values are numbers under the simulator's own names, in SI units. A missing value is not known; it is not zero.
"""

from __future__ import annotations

import math
from collections.abc import Callable, Mapping
from dataclasses import dataclass, field
from typing import Any, NoReturn

import numpy as np

from sonic_bullet._engine import power
from sonic_bullet.records.arrays import Array, frozen_array, store
from sonic_bullet.records.bodies import Material, ModalModel
from sonic_bullet.records.coerce import as_flag, as_kind, as_number, as_text, as_whole, quote
from sonic_bullet.records.errors import LogError, RecordError
from sonic_bullet.records.modal_options import ModalOptions
from sonic_bullet.records.mounting import Mounting, as_mounting

Values = Mapping[str, float]
"""Numbers by the simulator's own names for them; a missing number is not known."""


class ReadOnlyDict(dict[str, Any]):
    """A read-only dict that can be copied and pickled, which types.MappingProxyType cannot."""

    def _refuse(self, *_: object, **__: object) -> NoReturn:
        raise TypeError("these values are read-only")

    __setitem__ = __delitem__ = __ior__ = update = setdefault = pop = popitem = clear = _refuse

    def __reduce__(self) -> tuple[Any, ...]:
        """Pickle the dict by value."""
        return ReadOnlyDict, (dict(self),)


def frozen_values(values: object, name: str) -> Values:
    """Return finite numbers by name, read-only and sorted by name; raises RecordError."""
    return _frozen(values, name, "give a dict of names to numbers", as_number)


def frozen_texts(values: object, name: str) -> Mapping[str, str]:
    """Return texts by name, read-only and sorted by name; raises RecordError."""
    return _frozen(values, name, "give a dict of names to texts", as_text)


def _frozen(values: object, name: str, remedy: str, checked: Callable[[object, str, str], Any]) -> Mapping[str, Any]:
    if not isinstance(values, Mapping):
        raise RecordError(f"{name} is {quote(values)}", remedy)
    made = {
        as_text(key, f"a name in {name}", remedy): checked(x, f"{name}: {key}", remedy) for key, x in values.items()
    }
    return ReadOnlyDict(dict(sorted(made.items())))


@dataclass(frozen=True, slots=True, eq=False)
class Body:
    """One link of a simulated body, by value, so that a log renders without a simulator.

    Parameters
    ----------
    body_id, link
        As the user knows them (base is link -1).
    epoch
        Increases whenever ids may have been reused.
    name
        Unique to that link within a log; all its records have it.
    mass_kg
        The simulator's, 0 for a static body.
    inertia_kg_m2 : Array, shape (3, 3)
        Body frame, centre of mass.
    volume_m3
        Of the displaced air.
    curvature_per_m
        Of a shape with one curvature everywhere (sphere 1/r), else NaN: the model's surface has it.
    material
        None: a silent and rigid partner, static as rough as a floor, moving smooth.
    model
        None: it does not vibrate.
    since_step, until_step
        First step in which it exists for the sound, and first in which it no longer does, or -1.
    dynamics
        Friction, restitution, damping, mass, as the simulator has them when the record begins (see `Change`).
    options
        Modal options asked for; None without any, or where the model was given.
    mounting
        How it is held (`records.mounting`).
    silent
        No sensor receives it; it vibrates and touches as before.
    gain_db
        Gain of its sound at all sensors.
    flat_faces_m : Array, shape (k, 3, 3)
        Of a body that does not move, its large flat faces, which mirror sound, in its frame: middle and two half sides,
        whose product is outward.
    """

    body_id: int
    link: int
    epoch: int
    name: str
    mass_kg: float
    inertia_kg_m2: Array
    volume_m3: float = 0.0
    curvature_per_m: float = float("nan")
    material: Material | None = None
    model: ModalModel | None = None
    since_step: int = 0
    until_step: int = -1
    dynamics: Values = field(default_factory=dict)
    options: ModalOptions | None = None
    mounting: Mounting = "free"
    silent: bool = False
    gain_db: float = 0.0
    flat_faces_m: Array = field(default_factory=lambda: np.zeros((0, 3, 3)))

    def __post_init__(self) -> None:
        """Check the fields."""
        where = f"body {quote(self.body_id)} link {quote(self.link)}"
        store(
            self,
            inertia_kg_m2=frozen_array(self.inertia_kg_m2, float, (3, 3), f"{where}: inertia_kg_m2"),
            mass_kg=as_number(
                self.mass_kg, f"{where}: mass_kg", "give it a finite mass with changeDynamics", least=0, below=1e12
            ),
            volume_m3=as_number(self.volume_m3, f"{where}: volume_m3", "orient its mesh outward", least=0),
            dynamics=frozen_values(self.dynamics, f"{where}: dynamics"),
        )
        if self.options is not None:
            as_kind(self.options, ModalOptions, f"{where}: options", "give ModalOptions, or none")
        store(self, mounting=as_mounting(self.mounting, f"{where}: mounting"))
        as_flag(self.silent, f"{where}: silent")
        store(self, flat_faces_m=frozen_array(self.flat_faces_m, float, (None, 3, 3), f"{where}: flat_faces_m"))
        store(self, gain_db=as_number(self.gain_db, f"{where}: gain_db", "give a level in dB", least=-200, most=200))

    @property
    def gain(self) -> float:
        """Factor of gain_db."""
        return power(10.0, self.gain_db / 20)

    @property
    def sounding_gain(self) -> float:
        """The same; 0 of a silent body."""
        return 0.0 if self.silent else self.gain


@dataclass(frozen=True, slots=True)
class Change:
    """Values set differently between two physics steps, which hold from a step on.

    Parameters
    ----------
    step
        Number of the step before which it happened.
    body
        Index into the log's `bodies`; None: the engine.
    values
        Those that changed; None: no longer known.

    Raises
    ------
    LogError, RecordError
        A field is not valid.
    """

    step: int
    body: int | None
    values: Mapping[str, float | None]

    def __post_init__(self) -> None:
        """Check the fields."""
        remedy = "use an unbroken contact log"
        for name in ("step", "body"):
            if getattr(self, name) is not None or name == "step":
                as_whole(getattr(self, name), f"{name} of a change", remedy, least=0, error=LogError)
        known = frozen_values({name: x for name, x in self.values.items() if x is not None}, "a change")
        lost = {name: None for name in self.values if name not in known}
        store(self, values=ReadOnlyDict(dict(sorted((dict(known) | lost).items()))))


def with_body_id(name: str, body: int) -> str:
    """Format a body's or link's name with the body's id: "cube (body 3)"; "body 3" stays."""
    return name if name.split("/", maxsplit=1)[0] == f"body {body}" else f"{name} (body {body})"


@dataclass(frozen=True, slots=True)
class Simulator:
    """Properties that a simulator reports of itself.

    Parameters
    ----------
    engine
        Settings at the first step.
    versions
        Of the simulator, by name.
    changes
        Later changes of engine and bodies, in order.
    """

    engine: Values = field(default_factory=dict)
    versions: Mapping[str, str] = field(default_factory=dict)
    changes: tuple[Change, ...] = ()


def finite(values: Mapping[str, object]) -> dict[str, float]:
    """Select the values that are finite numbers."""
    return {
        name: float(x)
        for name, x in values.items()
        if isinstance(x, (int, float)) and not isinstance(x, bool) and math.isfinite(x)
    }
