"""Bodies of an environment that sound, with their materials; found anew in every episode, as ids change."""

from __future__ import annotations

import warnings
from collections.abc import Callable, Hashable, Mapping, Sequence
from functools import partial
from pathlib import Path
from typing import Any

from sonic_bullet.apps.environments.episode_steps import EpisodeWorld
from sonic_bullet.records import Material
from sonic_bullet.records.coerce import quote
from sonic_bullet.records.errors import MeshError, ModalError, SceneError, SceneWarning
from sonic_bullet.session import Listener
from sonic_bullet.session.arguments import as_material
from sonic_bullet.simulators.opening import is_mujoco

Cast = dict[tuple[int, Any], Any]
MaterialsLike = str | Path | Material | Mapping[Any, Any] | Callable[[Any], Mapping[Any, Any]]


def as_materials(materials: MaterialsLike) -> MaterialsLike:
    """Convert a material's name or file to the material, leave all else as it is; raises MaterialError."""
    return materials if callable(materials) or isinstance(materials, Mapping) else as_material(materials)


def cast_of(materials: MaterialsLike, client: Any) -> Cast:
    """Return a mapping from (body, link) to a material or the keywords of `Listener.add`.

    Parameters
    ----------
    materials
        One for every link with a collision shape; or a mapping from a body, a name, or (either, link) to one or to
        keywords; or a function of the client that returns such a mapping. A name means all bodies of that name.

    Raises
    ------
    SceneError
        No body has that name, or a function returns no mapping.
    """
    every, called = _links_of(client)
    if isinstance(materials, Material):
        return dict.fromkeys(every(), materials)
    given = materials(client) if callable(materials) else materials
    if not isinstance(given, Mapping):
        raise SceneError(f"materials(client) returned {quote(given)}", "return a dict from bodies to materials")
    cast: Cast = {}
    for who, how in given.items():
        body, link = who if isinstance(who, tuple) and len(who) == 2 else (who, -1)
        for one in called(body) if isinstance(body, str) else (body,):
            cast[one, link] = how
    return cast


def _links_of(client: Any) -> tuple[Callable[[], Sequence[tuple[int, int]]], Callable[[str], Sequence[Any]]]:
    """Return what lists all links that can touch, and what finds the bodies of a name."""
    if is_mujoco(client):
        from sonic_bullet.simulators.mujoco.model_links import ModelLinks

        return ModelLinks(client[0]).touching, lambda name: (name,)
    from sonic_bullet.simulators import bodies_called, client_id_of, links_with_shapes

    client_id = client_id_of(client)
    return partial(links_with_shapes, client_id), partial(bodies_called, client_id)


def same_cast(one: Any, other: Any) -> bool:
    """Tell whether two casts, or parts of them, are the same in order: equal numbers and texts, else one object."""
    if isinstance(one, Mapping) and isinstance(other, Mapping):
        return list(one) == list(other) and all(same_cast(one[name], other[name]) for name in one)
    return one is other or (isinstance(one, str | int | float) and type(one) is type(other) and one == other)


def add_fillable(listener: Listener, world: EpisodeWorld, cast: Cast, silent: set[Hashable]) -> Cast:
    """Add all links of a default cast except those that cannot be meshed or solved; return these.

    Each of them is named once, as a SceneWarning, and its likeness is added to ``silent``, whose links are skipped.
    """
    left_out = {who: how for who, how in cast.items() if world.likeness(*who) in silent}
    wanted = {who: how for who, how in cast.items() if who not in left_out}
    try:
        listener.add_all(wanted, optional=True)
    except (MeshError, ModalError):
        for (body, link), material in wanted.items():
            try:
                listener.add_all({(body, link): material}, optional=True)
            except (MeshError, ModalError) as error:
                silent.add(world.likeness(body, link))
                left_out[body, link] = material
                warnings.warn(f"left silent: {error.what}", SceneWarning, stacklevel=2)
    return left_out
