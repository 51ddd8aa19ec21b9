"""Choice of materials and of silent bodies of a scene or a log, given by a user apart from it.

material, materials by name, silent names -> MaterialChoice -> what is added (`choose_materials`)
                                                            -> bodies of a log (`session.chosen_in_log`)
"""

from __future__ import annotations

from collections.abc import Collection, Iterable, Iterator, Mapping, Sequence
from contextlib import contextmanager
from contextvars import ContextVar
from dataclasses import dataclass, field, replace
from itertools import groupby
from pathlib import Path
from typing import TYPE_CHECKING, Any

from sonic_bullet.effects.presets_of_effects import with_material
from sonic_bullet.engine.runtime.silence import can_sound
from sonic_bullet.options.render import SceneOptions
from sonic_bullet.records import Body, Material
from sonic_bullet.records.coerce import as_flag, as_items, quote
from sonic_bullet.records.counts import format_count
from sonic_bullet.records.errors import SceneError
from sonic_bullet.session.arguments import as_material, as_name
from sonic_bullet.simulators.names import match_name

if TYPE_CHECKING:
    from sonic_bullet.files.contact_log import ContactLog
    from sonic_bullet.session.body_requests import BodyRequest
    from sonic_bullet.simulators.world import World


@dataclass(frozen=True, slots=True, eq=False)
class MaterialChoice:
    """Materials and silent bodies that a user chose.

    Parameters
    ----------
    everyone
        Material of all that sounds; None: that of the scene or log.
    named
        Materials of links, or of all links of bodies, by name, which take precedence.
    silent
        Names of those that no sensor receives.
    fill_modes
        Whether plates and shells go on above their last mode, as by ``tail=True`` of `Listener.add`.
    draft
        Whether modes are few, and of coarse elements.
    """

    everyone: Material | None = None
    named: Mapping[str, Material] = field(default_factory=dict)
    silent: frozenset[str] = frozenset()
    fill_modes: bool = False
    draft: bool = False

    def __bool__(self) -> bool:
        """Tell whether anything was chosen."""
        return self.everyone is not None or bool(self.named) or bool(self.silent) or self.fill_modes or self.draft

    def material_of(self, name: str) -> Material | None:
        """Return the material of a link of that name, None without a choice."""
        found = match_name(name, self.named)
        return self.everyone if found is None else self.named[found]

    def names(self, name: str) -> bool:
        """Tell whether a material was chosen by name for a link of that name, or its body."""
        return match_name(name, self.named) is not None

    def is_silent(self, name: str) -> bool:
        """Tell whether a link of that name is to be silent."""
        return match_name(name, self.silent) is not None

    def check_names(self, names: Collection[str], where: str) -> None:
        """Raise SceneError where a chosen name is of no link and no body; it lists the names there are."""
        listed_names = 40  # most names in a line
        for one in (*self.named, *sorted(self.silent)):
            if not any(match_name(name, (one,)) for name in names):
                known = list(dict.fromkeys(names))
                more = f" and {len(known) - listed_names} more" if len(known) > listed_names else ""
                listed = ", ".join(known[:listed_names]) + more
                remedy = f"its bodies are: {listed or 'none'}{self._quote_name(one, known)}"
                raise SceneError(f"no body of {where} is called {quote(one)}", remedy)

    def _quote_name(self, one: str, known: Sequence[str]) -> str:
        """Show how a name with a space is given in a shell, if there is one: "body 1=glass"."""
        spaced = [name for name in known if " " in name]
        if not spaced:
            return ""
        rest = f"={self.named[one].name}" if one in self.named else ""
        return f'; quotes hold a name with a space together: "{spaced[-1]}{rest}"'

    def silent_notes(self, bodies: Iterable[Body]) -> tuple[str, ...]:
        """Return a line for each silenced name that is of none of these bodies that sound without it."""
        sounding = [body.name for body in bodies if body.material is not None and can_sound(body)]
        return tuple(
            f"{quote(one)} is silent anyway: silencing it changes nothing"
            for one in sorted(self.silent)
            if not any(match_name(name, (one,)) for name in sounding)
        )

    def check_added(self, added: Collection[str], scene: str) -> None:
        """Raise SceneError where a name with a material was never added by a scene's own listener."""
        for one in self.named:
            if not any(match_name(name, (one,)) for name in added):
                what = f"{quote(one)} is given a material, but scene '{scene}' never adds it to its listener"
                raise SceneError(what, f"add it there, or name who is added: {', '.join(added) or 'nobody'}")


def as_choice(
    material: str | Path | Material | None = None,
    materials: Mapping[str, str | Path | Material] | None = None,
    silent: Iterable[str] = (),
    fill_modes: bool = False,
    draft: bool = False,
) -> MaterialChoice:
    """Convert what a user gives to a choice.

    Raises
    ------
    MaterialError, FileError
        A preset cannot be read.
    SceneError
        A name is not valid.
    """
    remedy = "give a dict from bodies' names to materials"
    named = {} if materials is None else materials
    if not isinstance(named, Mapping):
        raise SceneError(f"materials is {quote(materials)}", remedy)
    names = as_items(silent, "silent", "give a list of bodies' names", error=SceneError)
    return MaterialChoice(
        None if material is None else as_material(material),
        {as_name(name): as_material(one) for name, one in named.items()},
        frozenset(as_name(name) for name in names),
        as_flag(fill_modes, "fill_modes"),
        as_flag(draft, "draft"),
    )


def choice_of(options: SceneOptions) -> MaterialChoice:
    """Return the choice that the options of a scene make; raises as `as_choice` does."""
    return as_choice(options.material, options.materials, options.silent, options.fill_modes, options.draft)


_choice: ContextVar[MaterialChoice] = ContextVar("choice", default=MaterialChoice())  # noqa: B039 - a frozen record


@contextmanager
def use_choice(choice: MaterialChoice) -> Iterator[None]:
    """Apply a choice to listeners that are made, and bodies that are added, within the block."""
    before = _choice.set(choice)
    try:
        yield
    finally:
        _choice.reset(before)


def current_choice() -> MaterialChoice:
    """Return the choice in use; an empty one by default."""
    return _choice.get()


def choose_materials(world: World, wanted: Sequence[BodyRequest]) -> Sequence[BodyRequest]:
    """Return the bodies to be added with the chosen materials, and with modes filled in where chosen.

    A body whose links get different materials becomes several entries, its links in the same order.
    """
    choice = current_choice()
    if choice.fill_modes:
        wanted = [replace(one, options=replace(one.options, tail=True)) for one in wanted]
    if choice.draft:
        wanted = draft_requests(wanted)
    if choice.everyone is None and not choice.named:
        return wanted
    given = [
        (one.body, link, one.names[i] if one.names else None) for one in wanted for i, link in enumerate(one.links)
    ]
    names = iter(world.record_names(given))
    made: list[BodyRequest] = []
    for one in wanted:
        chosen = [choice.material_of(next(names)) for _ in one.links]
        for material, run in groupby(range(len(one.links)), key=lambda i: chosen[i]):
            part = _some_links(one, list(run))
            made.append(part if material is None else replace(part, material=with_material(material), model=None))
    return made


def draft_notes(log: ContactLog) -> tuple[str, ...]:
    """Return a line on a log's modes that are drafts."""
    drafts = [body for body in log.bodies if body.options is not None and body.options.draft]
    solved = [body for body in drafts if body.model is not None and not body.model.unsolved]
    if not solved:
        return ()
    return (
        f"a draft: the modes of {format_count(len(solved), 'body', 'bodies')} are few, of coarse elements; octaves "
        "from 200 Hz to 8 kHz may be 10 dB off, 20 dB where walls are thin or modes many, and pitches are not right; "
        "render without --draft for the sound",
    )


def draft_requests(wanted: Sequence[BodyRequest]) -> list[BodyRequest]:
    """Return the bodies to be added, with few modes of coarse elements."""
    return [replace(one, options=replace(one.options, draft=True)) for one in wanted]


def _some_links(one: BodyRequest, which: Sequence[int]) -> BodyRequest:
    if len(which) == len(one.links):
        return one
    parts: dict[str, Any] = {
        name: tuple(value[i] for i in which) if (value := getattr(one, name)) else ()
        for name in ("links", "parts", "names")
    }
    return replace(one, **parts)
