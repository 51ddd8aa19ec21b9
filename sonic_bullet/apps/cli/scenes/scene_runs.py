"""Options of a scene or a contact log, and its run or replay, for `render`, `film` and `play`."""

from __future__ import annotations

from collections.abc import Callable
from contextlib import nullcontext
from dataclasses import dataclass, field, replace
from pathlib import Path
from typing import TYPE_CHECKING, Any

from sonic_bullet.apps.cli.output import quiet_stderr
from sonic_bullet.records.errors import AudioError, FileError, MaterialError, SonicBulletError
from sonic_bullet.records.file_endings import SCENE_ENDINGS
from sonic_bullet.records.regular_files import check_regular

if TYPE_CHECKING:
    from sonic_bullet.engine.path.room.room_plan import RoomPlan
    from sonic_bullet.files.contact_log import ContactLog
    from sonic_bullet.files.storage.spooled_sound import KeptSound
    from sonic_bullet.records import RoomResponse, ShoeboxRoom
    from sonic_bullet.scene import RenderResult
    from sonic_bullet.session import Listener
    from sonic_bullet.session.material_choice import MaterialChoice
    from sonic_bullet.simulators.pictures import Standing

DEFAULT_SR = 48_000


@dataclass(frozen=True, slots=True)
class WantedMaterials:
    """The options --material, --silent, --fill-modes and --draft.

    everyone: of all that sounds; named: by names of bodies; silent: names.
    """

    everyone: str | None = None
    named: dict[str, str] = field(default_factory=dict)
    silent: tuple[str, ...] = ()
    fill_modes: bool = False
    draft: bool = False

    @classmethod
    def read(
        cls, material: tuple[str, ...], silent: tuple[str, ...], fill_modes: bool = False, draft: bool = False
    ) -> WantedMaterials:
        """Read M or NAME=M; a file whose name holds an "=" is not split.

        Every M is read once, to report a wrong one before anything runs. Raises MaterialError, FileError.
        """
        from sonic_bullet.files.presets import load_material

        everyone, named = None, {}
        for given in material:
            name, equals, of = ("", "", given) if "=" not in given or Path(given).is_file() else given.partition("=")
            if equals and not (name.strip() and of.strip()):
                raise MaterialError(f"--material {given} is neither M nor NAME=M", "give --material bowl=steel")
            load_material(of)
            if (equals and name in named) or (not equals and everyone is not None):
                whom = name if equals else "all bodies"
                raise MaterialError(f"--material says twice what {whom} is made of", "give it once")
            if equals:
                named[name] = of
            else:
                everyone = of
        twice = next((name for name in silent if silent.count(name) > 1), None)
        if twice is not None:
            raise FileError(f"--silent names {twice} twice", "give it once")
        return cls(everyone, named, silent, fill_modes, draft)

    @property
    def options(self) -> dict[str, Any]:
        """Options of `render_scene` and `run_scene`."""
        return {
            "material": self.everyone, "materials": self.named, "silent": self.silent, "fill_modes": self.fill_modes,
            "draft": self.draft,
        }  # fmt: skip

    def choice(self) -> MaterialChoice:
        """Read the presets and return the choice."""
        from sonic_bullet.session.material_choice import as_choice

        return as_choice(self.everyone, self.named, self.silent, self.fill_modes, self.draft)


@dataclass(frozen=True, slots=True)
class Wish:
    """Options of a render; None and empty: as the scene or the log has them."""

    seconds: float | None
    rate: int | None
    microphones: tuple[tuple[float, float, float], ...]
    seed: int | None
    materials: WantedMaterials
    residual: bool | None
    supports: bool | None
    at_end: Callable[[Listener], object] | None = None
    tail_db: float | None = None
    room: ShoeboxRoom | RoomResponse | None = None
    feels_all: bool = False
    image: bool | None = None
    client: int | None = None


def is_log(scene: str) -> bool:
    """Tell by its name whether a scene is a contact log."""
    return Path(scene).suffix.lower() == ".npz"


def check_scene_file(scene: str, verb: str) -> None:
    """Raise FileError where there is neither a scene nor a contact log to render or play."""
    check_regular(scene, "give a scene (.py .gltf .glb) or a contact log (.npz)")
    if Path(scene).suffix.lower() not in (*SCENE_ENDINGS, ".npz"):
        raise FileError(
            f"cannot {verb} {scene}: neither a scene nor a contact log",
            "give a file that ends in .py, .gltf, .glb or .npz",
        )


def standing_collector(standing: list[Standing]) -> Callable[[Listener], None]:
    """Return a function that, at a scene's end, lists the shapes of its silent partners, for a film."""

    def at_end(listener: Listener) -> None:
        from sonic_bullet.simulators import PyBulletWorld
        from sonic_bullet.simulators.pictures import standing_in

        if isinstance(listener.world, PyBulletWorld):
            standing.extend(standing_in(listener.world.client_id))

    return at_end


def simulated(scene: str, wish: Wish) -> RenderResult:
    """Run a scene."""
    with quiet_stderr():
        from sonic_bullet.scene import render_scene
        from sonic_bullet.session.felt_bodies import feeling_all

    sr, places = wish.rate or DEFAULT_SR, wish.microphones or None
    asked: dict[str, Any] = {
        "seconds": wish.seconds,
        "sr": sr,
        "seed": wish.seed or 0,
        "microphones": places,
        "residual": wish.residual is not False,
        "supports": wish.supports is not False,
        "image": wish.image,
        "tail_db": wish.tail_db,
        "client": wish.client,
        **wish.materials.options,
    }
    with feeling_all() if wish.feels_all else nullcontext():
        return render_scene(scene, **asked, at_end=wish.at_end)


@dataclass(frozen=True, slots=True, eq=False)
class Replay:
    """A `RenderResult` of a log; that class needs PyBullet, a replay does not."""

    sound: KeptSound
    log: ContactLog
    sr: int
    notes: tuple[str, ...] = ()
    plan: RoomPlan | None = None


def replayed(path: str, wish: Wish) -> Replay:
    """Render a log: bit for bit the render it came from, where no option changes it."""
    log, _, said = prepared(path, wish)
    return rendered(log, wish, said)


def prepared(path: str, wish: Wish) -> tuple[ContactLog, Wish, tuple[str, ...]]:
    """Return a log as it is to be rendered, the wish, and notes for the user."""
    import numpy as np

    from sonic_bullet.files import read_log
    from sonic_bullet.records import Microphone
    from sonic_bullet.session.chosen_in_log import with_choice

    log, said = with_choice(read_log(path), wish.materials.choice(), path)
    if wish.microphones:
        log = replace(log, sensors=tuple(Microphone(np.array(place)) for place in wish.microphones))
    if wish.seed is not None:
        log = replace(log, seed=wish.seed)
    if wish.residual is not None:
        log = replace(log, residual=wish.residual)
    if wish.supports is not None:
        log = replace(log, supports=wish.supports)
    if wish.image is not None:
        log = replace(log, image=wish.image)
    if (seconds := wish.seconds) is not None:
        if seconds > log.duration_s + 1e-9:
            raise AudioError(
                f"{path} lasts {log.duration_s:.3f} s, shorter than {seconds} s",
                "give fewer seconds, or simulate the scene for longer",
            )
        log = log.first(int((log.start_s < seconds - 1e-9).sum()))
    return log, wish, said


def rendered(log: ContactLog, wish: Wish, said: tuple[str, ...]) -> Replay:
    """Render a log as it is."""
    from sonic_bullet.engine.path.room import room_of
    from sonic_bullet.engine.runtime.replay import render_kept, render_notes

    rate, plan = wish.rate or log.sr, None
    if wish.room is not None:
        plan = room_of(wish.room, replace(log, sr=rate))
        said = (*said, plan.note)
    try:
        sound = render_kept(log, sr=wish.rate, tail_db=wish.tail_db, plan=plan)
    except (SonicBulletError, KeyboardInterrupt) as error:
        error.partial = Replay(error.kept, log, rate) if hasattr(error, "kept") else None  # type: ignore[union-attr]
        raise
    notes = tuple(dict.fromkeys((*said, *render_notes(sound, log))))
    return Replay(sound, log, rate, notes, plan)
