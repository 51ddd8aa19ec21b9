"""Write a contact log of any simulator, from plain arrays.

add(name, mesh, material) -> ArrayWorld.define, Listener.add: modes
step(dt, poses, contacts) -> ArrayWorld.advance -> Step -> log     save -> npz -> `sonic-bullet render`
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import replace
from pathlib import Path
from typing import Any

from sonic_bullet.effects.presets_of_effects import with_material
from sonic_bullet.files.contact_log import ContactLog
from sonic_bullet.geometry import solid_of
from sonic_bullet.options.render import DEFAULT_MICROPHONE
from sonic_bullet.records import Air, Material, Shape
from sonic_bullet.records.coerce import check_options
from sonic_bullet.records.errors import SceneError
from sonic_bullet.records.sensors import MicrophoneLike
from sonic_bullet.session.arguments import as_material, as_name, as_sensors, as_shapes, keywords
from sonic_bullet.session.listening import Listener
from sonic_bullet.simulators.tables.array_world import ArrayWorld


class LogWriter:
    """A contact log written step by step, by whatever simulates.

    Parameters
    ----------
    sr
        Sample rate in Hz that the log asks for.
    microphone, seed, air, supports, image
        As of `attach`.

    Raises
    ------
    AudioError, RecordError
        An argument is not valid.
    """

    def __init__(
        self,
        *,
        sr: int = 48_000,
        microphone: MicrophoneLike = DEFAULT_MICROPHONE,
        seed: int = 0,
        air: Air | None = None,
        supports: bool = True,
        image: bool = False,
    ) -> None:
        self._sensors = as_sensors(microphone)
        self._world = ArrayWorld()
        how: dict[str, Any] = {"sr": sr, "seed": seed, "air": Air() if air is None else air}
        how |= {"supports": supports, "image": image}
        self._listener = Listener(self._world, sensors=(), keep_sound=False, **how)

    def add(
        self,
        name: str,
        mesh: str | Path | Shape | Sequence[Shape],
        *,
        material: str | Path | Material | None = None,
        mass_kg: float | None = None,
        inertia_kg_m2: Any = None,
        centre_m: Any = None,
        **options: Any,
    ) -> int:
        """Add a body; return its number in `step`.

        Parameters
        ----------
        name
            Unlike all others'.
        mesh
            A file in metres or shapes, in the frame of its poses; ``Shape("plane")`` is ground.
        material
            A preset's name, a preset file or a `Material`; None: it touches, and is silent and rigid, as rough
            as a floor where it is static, smooth where it moves.
        mass_kg
            0: it does not move by itself. None: by its volume and its material's density; 0 of a plane.
        inertia_kg_m2 : Array, shape (3, 3) or (3,)
            About the centre of mass, in the axes of its poses; None: of a solid.
        centre_m : Array, shape (3,)
            Centre of mass in the frame of its poses; None: of a solid.
        options
            More keywords of `Listener.add`: model, roughness_m, fixed, thickness_m, to_hz, count, accuracy,
            mounting, tail.

        Raises
        ------
        SceneError, RecordError, MaterialError, MeshError, ModalError
            As of `Listener.add`; or a step was made already.
        """
        known = [one for one in keywords(Listener.add) if one not in ("material", "mesh", "name")]
        check_options(options, known, "add", error=SceneError)
        who, shapes = as_name(name), as_shapes(mesh)
        if who in [one.record.name for one in self._world.defined]:
            raise SceneError(f"the name '{who}' is another body's already", "give each its own")
        made = None if material is None else with_material(as_material(material))
        if mass_kg is None:
            volume = solid_of(shapes)[0]
            if volume and made is None:
                raise SceneError(f"{who} has neither mass nor material", "give mass_kg=, 0 if it does not move")
            mass_kg = volume * made.density_kg_m3 if made is not None else 0.0
        solid: dict[str, Any] = {"mass_kg": mass_kg, "inertia_kg_m2": inertia_kg_m2, "centre_m": centre_m}
        if material is None:
            check_options(options, (), "a body without material", error=SceneError)
            return self._world.define(who, shapes, **solid)
        number = self._world.define(who, shapes, **solid)
        try:
            self._listener.add(number, material=material, **options)
        except BaseException:
            self._world.drop_last()
            raise
        return number

    def mass_kg(self, body: int | str) -> float:
        """Return the mass of a body, by its number or name; raises SceneError."""
        return self._world.describe(*self._world.link_of(body)).mass_kg

    def step(self, dt_s: float, position_m: Any, quaternion_xyzw: Any, **contacts: Any) -> None:
        """Write a step that was made.

        Parameters
        ----------
        dt_s
            Its length in s.
        position_m, quaternion_xyzw : Array, shapes (b, 3), (b, 4)
            Poses of all bodies in the world at its start, in the order in which they were added.
        contacts
            The rest, by keyword, k contacts. ``pair`` (k, 2): numbers of the bodies a and b. ``point_m`` (k, 3): where
            they touched at the start, world. ``normal`` (k, 3): unit, from b to a. ``impulse_n_s`` (k, 3): what the
            step gave to a, friction included. ``gap_m`` (k,): distance at the start, negative where they overlapped,
            which tells when they met; 0 or left out: not known. ``velocity_m_s``, ``spin_rad_s`` (b, 3): at the start,
            of the centres of mass; differences of the poses if left out. ``gravity_m_s2`` (3,): 9.81 downwards if left
            out. ``moved``: numbers of bodies set elsewhere by hand since the last step.

        Raises
        ------
        SceneError, RecordError
            An argument is not valid.
        """
        check_options(contacts, keywords(ArrayWorld.advance), "step", error=SceneError)
        self._world.advance(dt_s, position_m, quaternion_xyzw, **contacts)

    @property
    def log(self) -> ContactLog:
        """The log so far."""
        return replace(self._listener.contacts, sensors=self._sensors)

    def save(self, path: str | Path, models: object = "included") -> None:
        """Write the log as npz, whole or not at all; models: as of `ContactLog.save`. Raises FileError."""
        self.log.save(path, models)
