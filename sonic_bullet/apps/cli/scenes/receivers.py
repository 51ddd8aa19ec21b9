"""Where a render is listened from, and how: microphones that move or touch, ambisonics, heads.

SpaceOptions -> Receivers, checked -> sensors of a log, in the place of its own
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, replace
from pathlib import Path
from typing import TYPE_CHECKING, Any

from sonic_bullet.apps.cli.commands import Numbers
from sonic_bullet.options.render import SpaceOptions
from sonic_bullet.records.errors import FileError, SceneError
from sonic_bullet.records.regular_files import check_regular

if TYPE_CHECKING:
    from sonic_bullet.files import ContactLog
    from sonic_bullet.records import Array, Body, Head, Microphone, Sensor, SensorResponse, Vibrometer


@dataclass(frozen=True, slots=True)
class SurfaceSensorOption:
    """A sensor on a surface that is asked for.

    The option, the body's name, place and direction in its frame, response and noise.
    """

    option: str
    name: str
    place_m: tuple[float, ...]
    direction: tuple[float, ...]
    chain: tuple[SensorResponse | None, float] = (None, 0.0)

    @classmethod
    def read(
        cls, option: str, given: str, chain: tuple[SensorResponse | None, float] = (None, 0.0)
    ) -> SurfaceSensorOption:
        """Read NAME[=X,Y,Z[,DX,DY,DZ]]. Raises click.BadParameter."""
        name, _, place = given.partition("=")
        six = place.count(",") == 5
        numbers = Numbers("X,Y,Z,DX,DY,DZ" if six else "X,Y,Z").convert(place, None, None) if place else (0.0,) * 3
        return cls(option, name, numbers[:3], numbers[3:] or (0.0, 0.0, 1.0), chain)

    def sensor(self, log: ContactLog, where: str) -> Vibrometer:
        """Put it on the body of that name. Raises SceneError."""
        import numpy as np

        from sonic_bullet.records import ContactMicrophone, Vibrometer

        body = _body_called(log, self.name, f"--{self.option}", where)
        where_on = (body.body_id, np.array(self.place_m), np.array(self.direction), body.link)
        return Vibrometer(*where_on) if self.option == "vibrometer" else ContactMicrophone(*where_on, *self.chain)


@dataclass(frozen=True, slots=True)
class Receivers:
    """What is asked for; paths: read; on: names of bodies and places in their frames."""

    ambisonics: int | None = None
    head: Head | None = None
    facing: tuple[float, float, float] | None = None
    paths: tuple[Microphone, ...] = ()
    on: tuple[tuple[str, tuple[float, ...]], ...] = ()
    touching: tuple[SurfaceSensorOption, ...] = ()
    directivity: bool = False

    @classmethod
    def read(cls, options: SpaceOptions) -> Receivers:
        """Read the options. Raises FileError where a file cannot be read, or options contradict each other."""
        ambisonics, head, contact_response = options.ambisonics, options.head, options.contact_response
        contact_noise = options.contact_noise
        if ambisonics is not None and head is not None:
            raise FileError("--ambisonics and --head say both how a microphone hears", "give one of both")
        on = []
        for given in options.microphone_on:
            name, _, place = given.partition("=")
            numbers = Numbers("X,Y,Z").convert(place, None, None) if place else (0.0, 0.0, 0.0)
            on.append((name, numbers))
        found = None
        if head is not None:
            from sonic_bullet.files.sofa.heads import read_head

            found = read_head(head)
        chain_options = {"--contact-response": contact_response, "--contact-noise": contact_noise}
        if not options.contact_microphone and any(value is not None for value in chain_options.values()):
            option = next(name for name, value in chain_options.items() if value is not None)
            raise FileError(f"{option} is of a contact microphone, and there is none", "give --contact-microphone too")
        response = None
        if contact_response is not None:
            from sonic_bullet.files.responses.sensor_responses import read_response

            response = read_response(contact_response)
        chain = response, 0.0 if contact_noise is None else contact_noise
        touching = [SurfaceSensorOption.read("contact-microphone", one, chain) for one in options.contact_microphone]
        touching += [SurfaceSensorOption.read("vibrometer", one) for one in options.vibrometer]
        paths = tuple(read_path(path) for path in options.microphone_path)
        return cls(ambisonics, found, options.facing, paths, tuple(on), tuple(touching), options.directivity)

    def __bool__(self) -> bool:
        """Return whether anything is asked for."""
        asked = self.ambisonics, self.head, self.facing, self.directivity, self.paths, self.on, self.touching
        return any(bool(one) for one in asked)

    @property
    def channels(self) -> int:
        """Number of channels that each microphone has."""
        return (self.ambisonics + 1) ** 2 if self.ambisonics is not None else 1 + (self.head is not None)

    def apply_to(self, log: ContactLog, where: str) -> tuple[ContactLog, tuple[str, ...]]:
        """Give the log such sensors, and what a user should read of them. Raises SceneError."""
        moving: list[Any] = [*self.paths, *(_on_body(log, name, place, where) for name, place in self.on)]
        moving += [one.sensor(log, where) for one in self.touching]
        sensors, notes = self.with_receivers(moving or log.sensors, log.sr)
        return replace(log, sensors=sensors), notes

    def check_live(self) -> None:
        """Raise FileError where a microphone is on a body of a scene, which has no names before it runs."""
        for option, given in (("--microphone-on", self.on), *((f"--{one.option}", one) for one in self.touching)):
            if given:
                raise FileError(
                    f"{option} names a body, and bodies have names once a scene has run",
                    "play its log: render SCENE.py -o NAME.wav --contacts NAME.npz",
                )

    def with_receivers(self, sensors: Sequence[Sensor], sr: int) -> tuple[tuple[Sensor, ...], tuple[str, ...]]:
        """Let the microphones among sensors listen as is asked for; also return what a user should read.

        Raises SceneError.
        """
        from sonic_bullet.records import Ambisonics, Binaural, Microphone

        made, notes = list(sensors), []
        for i, one in enumerate(made):
            if not isinstance(one, Microphone):
                continue
            how: dict[str, Any] = {name: getattr(one, name) for name in ("quaternion_xyzw", "body_id", "link", "path")}
            how["position_m"] = None if one.path is not None else one.position_m
            how["directivity"] = one.directivity or self.directivity
            if self.facing is not None:
                how["quaternion_xyzw"] = turn_to(one.position_m, self.facing)
            if self.ambisonics is not None:
                made[i] = Ambisonics(**how, order=self.ambisonics)
            elif self.head is not None:
                made[i] = Binaural(**how, head=self.head)
                if self.head.sr != sr:
                    notes.append(f"{self.head.name} is resampled from {self.head.sr} Hz to {sr} Hz")
            else:
                made[i] = replace(one, quaternion_xyzw=how["quaternion_xyzw"], directivity=how["directivity"])
        return tuple(made), tuple(dict.fromkeys(notes))


def _on_body(log: ContactLog, name: str, place: tuple[float, ...], where: str) -> Microphone:
    """Put a microphone on the body of that name."""
    import numpy as np

    from sonic_bullet.records import Microphone

    body = _body_called(log, name, "--microphone-on", where)
    return Microphone(np.array(place), body_id=body.body_id, link=body.link)


def _body_called(log: ContactLog, name: str, option: str, where: str) -> Body:
    """Find a body that sounds by its name. Raises SceneError."""
    from sonic_bullet.records.coerce import nearest

    known = {body.name: body for body in log.bodies if body.material is not None}
    if name not in known:
        raise SceneError(f"{option} {name}: nothing that sounds in {where} is called that", nearest(name, known))
    return known[name]


def turn_to(place_m: Array, target_m: tuple[float, float, float]) -> Array:
    """Compute the quaternion that turns x towards a point, y level. Raises SceneError where the point is the place."""
    import numpy as np

    toward = np.array(target_m, float) - place_m
    length = float(np.linalg.norm(toward))
    if length < 1e-9:
        raise SceneError("--facing is where the microphone is", "give another point")
    azimuth, elevation = np.arctan2(toward[1], toward[0]), np.arcsin(np.clip(toward[2] / length, -1, 1))
    (sz, cz), (sy, cy) = ((np.sin(a / 2), np.cos(a / 2)) for a in (azimuth, -elevation))
    return np.array([-sz * sy, cz * sy, sz * cy, cz * cy])


def read_path(path: str) -> Microphone:
    """Read the microphone of the path that a table of numbers has. Raises FileError."""
    import numpy as np

    from sonic_bullet.records import Microphone, MicrophonePath

    check_regular(path)
    try:
        lines = Path(path).read_text(encoding="utf-8").splitlines()
    except (OSError, UnicodeDecodeError) as error:
        why = getattr(error, "strerror", None) or "no text"
        raise FileError(f"cannot read {path}: {why}", "give a table: time in s, x, y, z in m") from None
    rows: list[list[float]] = []
    path_columns = (4, 8)  # of a path's table: time and place, and, it may be, the quaternion
    for number, line in enumerate(lines, 1):
        parts = line.replace(";", ",").split(",")
        try:
            row = [float(part) for part in parts]
        except ValueError:
            if line.strip() and rows:
                raise FileError(f"{path}:{number}: no row of numbers", "give time in s, x, y, z in m") from None
            continue  # a heading, an empty line
        if len(row) not in path_columns or (rows and len(row) != len(rows[0])):
            raise FileError(
                f"{path}:{number}: {len(row)} numbers", "give time in s, x, y, z in m, and x, y, z, w of it"
            )
        rows.append(row)
    if not rows:
        raise FileError(f"{path} holds no row of numbers", "give time in s, x, y, z in m")
    table = np.array(rows)
    turned = table[:, 4:] if table.shape[1] == 8 else None
    return Microphone(path=MicrophonePath(table[:, 0], table[:, 1:4], turned))
