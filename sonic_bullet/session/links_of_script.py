"""Links of a script that names no materials: which of them sound, and which are silent partners.

link -> its shapes -> ground: a silent partner with concrete's contact
                   -> not understood, or without modes: a silent partner that a note names, with the remedy
                   -> else it sounds
"""

from __future__ import annotations

from collections.abc import Callable, Mapping

from sonic_bullet.records import Material, Shape
from sonic_bullet.records.errors import MaterialError, SonicBulletError
from sonic_bullet.session.arguments import as_material
from sonic_bullet.session.first_checks import is_ground, sides_m
from sonic_bullet.session.listening import Listener
from sonic_bullet.session.material_choice import MaterialChoice, current_choice
from sonic_bullet.simulators.world import World


def add_links(
    listener: Listener,
    cast: Mapping[tuple[int, int], Material],
    static: Callable[[int, int], bool],
) -> tuple[str, ...]:
    """Add those links that can sound, each with its material; return notes on the silent partners.

    A link that fails does not affect the others. static: tells whether a link can never move.
    """
    notes: list[str] = []
    sounding: dict[tuple[int, int], Material] = {}
    for who, material in cast.items():
        try:
            shapes = listener.world.shapes_of(*who)
            if static(*who) and is_ground(shapes):
                made = _chosen_by_name(listener, who) or as_material("concrete")
                listener.world.add(*who, material=made)
                name = listener.world.name_of(*who)
                notes.append(f"{name} is ground ({_long(shapes)}): a silent partner with {made.name}'s contact")
                continue
            sounding[who] = material
        except SonicBulletError as error:
            notes.append(_silent(listener, who, error))
    try:
        listener.add_all(sounding, optional=True)
    except MaterialError:
        raise
    except SonicBulletError:
        for who, material in sounding.items():
            try:
                listener.add_all({who: material}, optional=True)
            except SonicBulletError as error:
                notes.append(_silent(listener, who, error))
    return tuple(notes)


def named_links(world: World, choice: MaterialChoice) -> dict[tuple[int, int], Material]:
    """Return the links, not added yet, to which a choice gives a material by name."""
    added = {(body.body_id, body.link) for body in world.living if body.material is not None}
    links = [who for who in world.all_links() if who not in added]
    found = zip(links, world.record_names([(*who, None) for who in links]), strict=True)
    made = {who: choice.material_of(name) for who, name in found if choice.names(name)}
    return {who: one for who, one in made.items() if one is not None}


def _silent(listener: Listener, who: tuple[int, int], error: SonicBulletError) -> str:
    how_it_sounds = "it sounds where the script attaches a listener and adds it with mesh="
    name = listener.world.name_of(*who)
    what = error.what.removeprefix(f"{name}: ")
    return f"{name} is a silent partner: {what}; {how_it_sounds}"


def _chosen_by_name(listener: Listener, who: tuple[int, int]) -> Material | None:
    choice, (name,) = current_choice(), listener.world.record_names([(*who, None)])
    return choice.material_of(name) if choice.names(name) else None


def _long(shapes: tuple[Shape, ...]) -> str:
    if any(shape.kind == "plane" for shape in shapes):
        return "an endless plane that never moves"
    return f"static, {float(sides_m(shapes).max()):.3g} m long"
