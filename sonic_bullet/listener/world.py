"""What a simulator must tell a listener.

PyBullet is one (listener/pybullet/), a contact log played back is another (tests).

    the simulator steps -> after_step() -> Step (records.contacts)

A second simulator derives from `World` and is handed to `sonic_bullet.attach` in place of a client.
"""

from __future__ import annotations

from abc import ABC, abstractmethod
from collections.abc import Callable, Collection, Mapping, Sequence

from sonic_bullet.records import Body, Material, ModalModel, Shape
from sonic_bullet.records.contacts import Step
from sonic_bullet.records.errors import SceneError
from sonic_bullet.records.modal_options import ModalOptions
from sonic_bullet.records.mounting import Mounting
from sonic_bullet.records.simulated import Simulator


class World(ABC):
    """Bodies, poses, twists, contacts and step lengths of one simulated world."""

    stepped: bool
    """Whether the last `after_step` found a step: a second call without one between finds none."""
    emptied = 0
    """How often the world has lost all its bodies at once (PyBullet's resetSimulation), as far as that is seen."""
    logged = True
    """False where nobody keeps a log: what only a log needs may be dropped, records of who is gone first of all."""

    @property
    @abstractmethod
    def bodies(self) -> tuple[Body, ...]:
        """All bodies ever met, in the order that Contacts.a and Contacts.b count them; the living alone where
        `logged` is False.
        """

    @property
    def records(self) -> Sequence[Body] | Mapping[int, Body]:
        """`bodies` by what Contacts.a and Contacts.b count: an index is of one body for ever, whoever is dropped."""
        return self.bodies

    @property
    def living(self) -> tuple[Body, ...]:
        """Those of `bodies` that are there now."""
        return tuple(body for body in self.bodies if body.until_step < 0)

    @property
    def untouched(self) -> frozenset[int]:
        """Ids of the bodies that are in the world and have met nobody yet."""
        return frozenset()

    @property
    def notes(self) -> tuple[str, ...]:
        """What of the world is left out of the sound, and why."""
        return ()

    @property
    def simulator(self) -> Simulator:
        """What the simulator says of itself, for the log: nothing, unless it has something to say."""
        return Simulator()

    @property
    def has_bodies(self) -> bool:
        """Whether there is any body in the world."""
        return bool(self.bodies)

    @abstractmethod
    def links_called(self, body: object, link: object) -> tuple[int, tuple[int, ...]]:
        """The body's id and its links of that number or name, "all" of them. Raises SceneError."""

    @abstractmethod
    def name_of(self, body: int, link: int = -1) -> str:
        """What people call a link. Raises SceneError for an unknown one."""

    def record_names(self, links: Sequence[tuple[int, int, str | None]]) -> list[str]:
        """What the records of links (body, link, name to be given) are or would be called, if all were added now."""
        return [given or self.name_of(body, link) for body, link, given in links]

    def all_links(self) -> tuple[tuple[int, int], ...]:
        """(body, link) of every link in the world that could touch something; by default of those in `living`."""
        return tuple((body.body_id, body.link) for body in self.living)

    def silence(self, names: Collection[str]) -> None:
        """Records of links, or of all links of bodies, called so are `silent` from now on. Raises SceneError."""
        if names:
            raise SceneError("this simulator silences nobody", "leave silent out")

    @abstractmethod
    def shapes_of(self, body: int, link: int = -1) -> tuple[Shape, ...]:
        """Geometry of a link in its body frame. Raises SceneError for an unknown one, MeshError where it has none."""

    @abstractmethod
    def add(
        self,
        body: int,
        link: int = -1,
        *,
        material: Material | None = None,
        model: ModalModel | None = None,
        shapes: Sequence[Shape] = (),
        options: ModalOptions | None = None,
        mounting: Mounting | None = None,
    ) -> Body:
        """Make a link known with what it is made of; its record, which `bodies` holds from now on.

        options: what was asked of its modes, for the record. mounting: how it is held, None: as is usual.

        Raises SceneError.
        """

    def call(self, body: int, link: int, name: str) -> None:
        """Call a link so from now on. Raises SceneError where that cannot be."""
        raise SceneError("this simulator's bodies bring their names", "leave name out")

    def link_name(self, body: int, link: int) -> str:
        """A link's own name, without its body's."""
        return str(link)

    @abstractmethod
    def after_step(self) -> Step:
        """The record of the step just made. Raises SceneError."""

    def reset(self) -> None:
        """Begin anew, as a world that has just been opened and of which the same bodies were added, in the order in
        which they last were: steps and indices count from 0, who was met by itself is met anew, who is gone is
        forgotten, `notes` are empty. Raises SceneError, having changed nothing, where that is not possible.
        """
        raise SceneError("this world cannot begin anew", "attach a new listener, or give its World a `reset`")

    def listen(self, after: Callable[[], object]) -> bool:
        """Call ``after`` after every step from now on, if the simulator can; whether it does.

        Else somebody calls `Listener.step`.
        """
        return False

    def make_ready(self) -> None:  # noqa: B027 - not every simulator has any
        """Have the machine code that the first step would else wait for."""

    @abstractmethod
    def unhook(self) -> None:
        """Leave the simulator as it was; harmless when nothing listens."""
