"""What a simulator says of its bodies and of itself, by value.

    its own answers, and what hooks see being set -> Values -> Body.dynamics, Simulator -> ContactLog

Values are numbers under the simulator's own names, in SI units. A name that is not among them is not known: nobody said
it, and it is not zero.
"""

from __future__ import annotations

import math
from collections.abc import Callable, Mapping
from dataclasses import dataclass, field
from typing import Any, NoReturn

from sonic_bullet.records.arrays import Array, frozen_array, store
from sonic_bullet.records.bodies import Material, ModalModel
from sonic_bullet.records.coerce import as_flag, as_kind, as_number, as_text, as_whole, shown
from sonic_bullet.records.errors import LogError, RecordError
from sonic_bullet.records.modal_options import ModalOptions
from sonic_bullet.records.mounting import Mounting, as_mounting

Values = Mapping[str, float]
"""Numbers by the simulator's own names for them; what is not there is not known."""


class ReadOnlyDict(dict[str, Any]):
    """A dict that is as it was made; it can be copied and pickled, which types.MappingProxyType cannot."""

    def _refuse(self, *_: object, **__: object) -> NoReturn:
        raise TypeError("these values are read-only")

    __setitem__ = __delitem__ = __ior__ = update = setdefault = pop = popitem = clear = _refuse

    def __reduce__(self) -> tuple[Any, ...]:
        return ReadOnlyDict, (dict(self),)


def frozen_values(values: object, name: str) -> Values:
    """Finite numbers by name, read-only and in the order of their names. Raises RecordError."""
    return _frozen(values, name, "give a dict of names to numbers", as_number)


def frozen_texts(values: object, name: str) -> Mapping[str, str]:
    """Texts by name, read-only and in the order of their names. Raises RecordError."""
    return _frozen(values, name, "give a dict of names to texts", as_text)


def _frozen(values: object, name: str, remedy: str, checked: Callable[[object, str, str], Any]) -> Mapping[str, Any]:
    if not isinstance(values, Mapping):
        raise RecordError(f"{name} is {shown(values)}", remedy)
    made = {
        as_text(key, f"a name in {name}", remedy): checked(x, f"{name}: {key}", remedy) for key, x in values.items()
    }
    return ReadOnlyDict(dict(sorted(made.items())))


@dataclass(frozen=True, slots=True, eq=False)
class Body:
    """One link of one PyBullet body as the sound needs it, by value, so that a log renders without PyBullet.

    body_id, link: as the user knows them (base is link -1). epoch: grows whenever ids may have been given anew. name:
    that link's alone within a log, and all records of it have it. mass_kg: the simulator's, 0 for what does not move.
    inertia_kg_m2 (3, 3): body frame, centre of mass. volume_m3: of the displaced air. curvature_per_m: of a shape that
    has one everywhere (sphere 1/r), else NaN: then the model's surface tells. material None: a silent, smooth and rigid
    partner. model None: nothing of it vibrates. since_step: the first step in which it exists for the sound;
    until_step: the first in which it does not any more, or -1. dynamics: friction, restitution, damping, mass, as the
    simulator has them when the record begins (see `Change`). options: what was asked of its modes; None where nothing
    was, or the model was given. mounting: how it is held (`records.mounting`). silent: no sensor hears it; it vibrates
    and touches as it does otherwise. gain_db: how much louder sensors hear it than it is.
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

    def __post_init__(self) -> None:
        where = f"body {shown(self.body_id)} link {shown(self.link)}"
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
        store(self, gain_db=as_number(self.gain_db, f"{where}: gain_db", "give a level in dB", least=-200, most=200))

    @property
    def gain(self) -> float:
        """The factor that gain_db is."""
        return float(10 ** (self.gain_db / 20))


@dataclass(frozen=True, slots=True)
class Change:
    """What was set otherwise between two physics steps: values that hold from a step on.

    step: the number of the step before which it happened. body: index into the log's `bodies`; None: the engine.
    values: those that are others than before; None: no longer known. Raises LogError, RecordError.
    """

    step: int
    body: int | None
    values: Mapping[str, float | None]

    def __post_init__(self) -> None:
        remedy = "use an unbroken contact log"
        for name in ("step", "body"):
            if getattr(self, name) is not None or name == "step":
                as_whole(getattr(self, name), f"{name} of a change", remedy, least=0, error=LogError)
        known = frozen_values({name: x for name, x in self.values.items() if x is not None}, "a change")
        lost = {name: None for name in self.values if name not in known}
        store(self, values=ReadOnlyDict(dict(sorted((dict(known) | lost).items()))))


def with_body_id(name: str, body: int) -> str:
    """A body's or link's name in a message, with the body's id: "cube (body 3)"; "body 3" is plain enough."""
    return name if name.split("/", maxsplit=1)[0] == f"body {body}" else f"{name} (body {body})"


@dataclass(frozen=True, slots=True)
class Simulator:
    """What a simulator says of itself. engine: its settings at the first step; versions: of it, by name; changes: what
    was set otherwise later, of engine and bodies, in order.
    """

    engine: Values = field(default_factory=dict)
    versions: Mapping[str, str] = field(default_factory=dict)
    changes: tuple[Change, ...] = ()


def finite(values: Mapping[str, object]) -> dict[str, float]:
    """Those values that are finite numbers."""
    return {
        name: float(x)
        for name, x in values.items()
        if isinstance(x, (int, float)) and not isinstance(x, bool) and math.isfinite(x)
    }
