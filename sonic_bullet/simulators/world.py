"""Interface that a simulator implements for a listener.

PyBullet implements it (listener/pybullet/); a contact log played back is another implementation (tests).

    the simulator steps -> after_step() -> Step (records.contacts)

A second simulator derives from `World` and is passed to `sonic_bullet.attach` in place of a client.
"""

from __future__ import annotations

from abc import ABC, abstractmethod
from collections.abc import Callable, Collection, Mapping, Sequence

from sonic_bullet.records import Body, Material, ModalModel, Shape
from sonic_bullet.records.coerce import as_items, as_kind, as_number
from sonic_bullet.records.contacts import Step
from sonic_bullet.records.errors import SceneError
from sonic_bullet.records.modal_options import ModalOptions
from sonic_bullet.records.mounting import Mounting
from sonic_bullet.records.simulated import Simulator
from sonic_bullet.records.step_tables import StepTables

JointSprings = Mapping[int, tuple[float, float]]
"""By joint: stiffness in N·m/rad, of a sliding one in N/m, and loss factor."""


class World(ABC):
    """Bodies, poses, twists, contacts and step lengths of one simulated world."""

    stepped: bool
    """Whether the last `after_step` found a step: a second call without one between finds none."""
    waiting = 0
    """Contacts of the steps that wait to be `taken`."""
    newest_steps = 1
    """Records that the last `take_step` made: one, or one for each sub-step."""
    driven_contacts = True
    """Whether what is set step after step keeps its contacts. False: it jumps, for who finds them by poses alone."""
    emptied = 0
    """How often the world has lost all its bodies at once (PyBullet's resetSimulation), as far as that is observed."""
    felt: Collection[int] = ()
    """Ids of the bodies that sensors are on. Of jointed ones, steps tell how their links move (`Step.motions`)."""
    joint_springs: Mapping[int, JointSprings] = {}
    """By body: what holds its joints at audio rate, for sensors on its links (`hold_joints`)."""
    logged = True
    """False where no log is kept: data that only a log needs may be dropped, records of removed bodies above all."""

    @property
    @abstractmethod
    def bodies(self) -> tuple[Body, ...]:
        """All bodies ever met, in the order that Contacts.a and Contacts.b count them.

        Only the living ones where `logged` is False.
        """

    @property
    def records(self) -> Sequence[Body] | Mapping[int, Body]:
        """`bodies` by the index in Contacts.a and Contacts.b; an index means one body, whichever are dropped."""
        return self.bodies

    @property
    def living(self) -> tuple[Body, ...]:
        """Those of `bodies` that are there now."""
        return tuple(body for body in self.bodies if body.until_step < 0)

    @property
    def untouched(self) -> frozenset[int]:
        """Ids of the bodies in the world that have had no contact yet."""
        return frozenset()

    @property
    def notes(self) -> tuple[str, ...]:
        """Messages that say what of the world the sound leaves out, and why."""
        return ()

    @property
    def simulator(self) -> Simulator:
        """Properties of the simulator for the log; empty by default."""
        return Simulator()

    @property
    def has_bodies(self) -> bool:
        """Whether there is any body in the world."""
        return bool(self.bodies)

    @abstractmethod
    def links_called(self, body: object, link: object) -> tuple[int, tuple[int, ...]]:
        """Return the body's id and its links of that number or name, "all" of them.

        Raises
        ------
        SceneError
            There is no such body or link.
        """

    @abstractmethod
    def name_of(self, body: int, link: int = -1) -> str:
        """Return the name of a link for messages.

        Raises
        ------
        SceneError
            There is no such link.
        """

    def mass_of(self, body: int, link: int = -1) -> float | None:
        """Return the mass of a link in kg, 0 where it never moves; None: not known before it is added."""
        return None

    def settings_notes(self) -> tuple[str, ...]:
        """Return a line for each setting that would spoil the sound and that is known before the first step."""
        return ()

    def record_names(self, links: Sequence[tuple[int, int, str | None]]) -> list[str]:
        """Return the names that records of links (body, link, given name) have, or would have if all were added now."""
        return [given or self.name_of(body, link) for body, link, given in links]

    def all_links(self) -> tuple[tuple[int, int], ...]:
        """List (body, link) of every link in the world that could touch something; by default of those in `living`."""
        return tuple((body.body_id, body.link) for body in self.living)

    def silence(self, names: Collection[str]) -> None:
        """Mark as `silent`, from now on, records of links, or of all links of bodies, of these names.

        Raises
        ------
        SceneError
            The simulator cannot do that.
        """
        if names:
            raise SceneError("this simulator silences nobody", "leave silent out")

    @abstractmethod
    def shapes_of(self, body: int, link: int = -1) -> tuple[Shape, ...]:
        """Return the geometry of a link in its body frame.

        Raises
        ------
        SceneError
            There is no such link.
        MeshError
            It has no geometry.
        """

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
        """Register a link with its material or model; return its record, which `bodies` holds from now on.

        Parameters
        ----------
        body, link
        material, model, shapes
            What it is made of.
        options
            Modal options asked for, for the record.
        mounting
            How it is held; None: the usual mounting.

        Raises
        ------
        SceneError
            The link cannot be added.
        """

    def call(self, body: int, link: int, name: str) -> None:
        """Give a link a name.

        Raises
        ------
        SceneError
            That is not possible.
        """
        raise SceneError("this simulator's bodies bring their names", "leave name out")

    def hold_joints(
        self, body: int, springs: Mapping[int | str, tuple[float, float]] | None = None, factor: float = 1
    ) -> None:
        """Let springs hold joints of a body at audio rate, in place of earlier ones: gears and belts, not controllers.

        Parameters
        ----------
        body
            The id that loading it returned.
        springs
            By the name or number of the link that a joint moves, "all" for each: stiffness in N·m/rad (of a sliding
            joint N/m) and loss factor. There are none by default: an id alone is an error that names them.
        factor
            Of each stiffness, such as one that is drawn.

        Raises
        ------
        SceneError
            There is no such body or link.
        RecordError
            A number is not what it may be.
        """
        held: dict[int, tuple[float, float]] = {}
        springs = as_kind(springs, dict, "springs of joints", 'give {"all": (2e4, 0.05)}, or link by link')
        more = as_number(factor, "factor of a joint's stiffness", "give a number above 0", above=0)
        for link, pair in springs.items():
            found, links = self.links_called(body, link)
            name, remedy = f"spring of joint {link}", "give stiffness in N·m/rad and loss factor, such as (2e4, 0.05)"
            two = as_items(pair, name, remedy)
            stiffness, loss = (
                as_number(x, name, remedy, least=0, most=1e15) for x in (two if len(two) == 2 else (pair, pair))
            )
            held.update({one: (more * stiffness, loss) for one in links if one >= 0})
            self.joint_springs = {**self.joint_springs, found: held}

    def link_name(self, body: int, link: int) -> str:
        """Return a link's own name, without its body's."""
        return str(link)

    @abstractmethod
    def after_step(self) -> Step:
        """Return the record of the step just made.

        Raises
        ------
        SceneError
            The world cannot be read.
        """

    def take_step(self) -> Step | None:
        """Take in the step just made: its record or, where it waits to be `taken`, None. Raises as `after_step`."""
        return self.after_step()

    def take_waiting(self) -> list[StepTables]:
        """Return the steps that waited, which were made before the last record was; none of them waits any more."""
        return []

    def reset(self) -> None:
        """Restart, as a world just opened to which the same bodies were added, in the order in which they last were.

        Steps and indices count from 0, other bodies get records at their next contact, ended records are dropped,
        `notes` are empty.

        Raises
        ------
        SceneError
            That is not possible; nothing has changed then.
        """
        raise SceneError("this world cannot begin anew", "attach a new listener, or give its World a `reset`")

    def listen(self, after: Callable[[], object]) -> bool:
        """Call ``after`` after every step from now on, if the simulator can; return whether it does.

        Otherwise the caller has to call `Listener.step`.
        """
        return False

    @abstractmethod
    def unhook(self) -> None:
        """Remove the hooks from the simulator; harmless without any."""
