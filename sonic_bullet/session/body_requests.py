"""Bodies that are to sound: arguments, checked, and their modes, computed side by side where there are several.

    add's arguments -> BodyRequest, nothing changed yet -> outline_of -> a surface a link, in the world
        -> once it sounds: solved_links -> a modal model a link, its radiation known

Two processes fill the cache, each taking the next link: its modes, and how they radiate. They share nothing but cache
entries. All bodies are then solved in
order from the cache, as in one process: the same models, the same errors.
"""

from __future__ import annotations

import warnings
from collections.abc import Callable, Iterable, Iterator, Mapping, Sequence
from contextlib import contextmanager, suppress
from dataclasses import asdict, dataclass, replace
from functools import partial
from itertools import chain, islice
from pathlib import Path
from typing import TYPE_CHECKING, Any

import numpy as np

from sonic_bullet.effects.presets_of_effects import with_material
from sonic_bullet.files.storage.cache import kept_meanwhile
from sonic_bullet.files.storage.user_folder import unreported_note
from sonic_bullet.geometry import oversize
from sonic_bullet.machine.parallel import one_thread, parallel_map
from sonic_bullet.machine.progress import progress_under, report_progress, show_progress
from sonic_bullet.radiation.radiated import radiation_of
from sonic_bullet.records import Air, Material, ModalModel, Shape
from sonic_bullet.records.coerce import as_kind, as_number, check_options, quote
from sonic_bullet.records.counts import format_count
from sonic_bullet.records.errors import MeshError, ModalError, SceneError, SizeWarning, SonicBulletError
from sonic_bullet.records.modal_options import ModalOptions
from sonic_bullet.records.mounting import Mounting, as_mounting
from sonic_bullet.records.roughness import with_roughness
from sonic_bullet.session.arguments import as_material, as_name, as_shapes
from sonic_bullet.session.body_models import analyse_body
from sonic_bullet.session.directed import absent, direction
from sonic_bullet.simulators.frames import link_words
from sonic_bullet.simulators.world import World

if TYPE_CHECKING:
    from sonic_bullet.modal.meshing.shape_meshes import Outline

SIZE_REMEDY = "load it with globalScaling=0.001, or give its mesh in metres, if its numbers are millimetres"


@dataclass(frozen=True, slots=True, eq=False)
class BodyRequest:
    """A body and those links of it that are to sound.

    Parameters
    ----------
    parts
        Name and shapes of each link.
    model
        Of all links, where it is given.
    names
        Names given; empty: the simulator's.
    own_shapes
        The shapes were given, not taken from the world.
    optional
        That a link has no modes is no error.
    mounting
        None: the usual one.
    progress
        Called with what is computed for it, once it is.
    """

    body: int
    links: tuple[int, ...]
    parts: tuple[tuple[str, tuple[Shape, ...]], ...]
    material: Material
    options: ModalOptions
    model: ModalModel | None
    names: tuple[str, ...] = ()
    own_shapes: bool = False
    mounting: Mounting | None = None
    optional: bool = False
    progress: Callable[[str], None] | None = None


def wanted_cast(world: World, cast: object, names: Iterable[str]) -> list[BodyRequest]:
    """Convert a cast, of whose entries ``names`` are the keywords; raises SceneError for what is no mapping."""
    if not isinstance(cast, Mapping):
        raise SceneError(f"cast is {quote(cast)}", "give a dict from bodies to materials")
    found = []
    for who, how in cast.items():
        if absent(who):
            continue
        body, link = who if isinstance(who, tuple) and len(who) == 2 else (who, -1)
        given = how if isinstance(how, Mapping) else {"material": how}
        check_options(map(str, given), [name for name in names if name != "progress"], "add_all")
        found.append(wanted_body(world, body, link, **{"material": None, **given}))
    return found


def wanted_body(
    world: World,
    body: object,
    link: object = -1,
    *,
    material: str | Path | Material,
    mesh: str | Path | Shape | Sequence[Shape] | None = None,
    model: ModalModel | None = None,
    roughness_m: float | None = None,
    name: str | None = None,
    mounting: str | float | None = None,
    **options: Any,
) -> BodyRequest:
    """Check the arguments of `Listener.add`; raises what it raises. options: of modal.ModalOptions."""
    made = as_material(material)
    if roughness_m is not None:
        remedy = "give an rms height in m, zero or above"
        made = with_roughness(made, as_number(roughness_m, "roughness_m", remedy, least=0))
    made = with_material(made)
    asked = ModalOptions(**options)
    if model is not None:
        as_kind(model, ModalModel, "model", "give a ModalModel, or leave it out", error=ModalError)
    number, links = world.links_called(body, link)
    names = () if name is None else tuple(_names(world, number, links, as_name(name), link == "all"))
    given = None if mesh is None else as_shapes(mesh)
    parts = []
    for one, label in zip(links, names or [world.name_of(number, one) for one in links], strict=True):
        with _naming_link(label, len(links)):
            parts.append((label, world.shapes_of(number, one) if given is None else given))
    held = None if mounting is None else as_mounting(mounting, error=SceneError)
    return BodyRequest(number, links, tuple(parts), made, asked, model, names, given is not None, held)


def _names(world: World, body: int, links: Sequence[int], name: str, every: bool) -> Iterator[str]:
    """Yield the links' names where a name is given; "all" links append their own to it."""
    for link in links:
        yield f"{name}/{world.link_name(body, link)}" if every and link >= 0 else name


def check_requests(world: World, wanted: Sequence[BodyRequest]) -> Sequence[BodyRequest]:
    """Return the bodies to be added, as the run's hook has them.

    Raises
    ------
    SceneError
        A given name is another living link's, or given twice.
    """
    director = direction()
    if director is not None:
        wanted = director.replace_requests(world, wanted)
    bearer = {body.name: (body.body_id, body.link) for body in world.living}
    for one in wanted:
        for link, name in zip(one.links, one.names, strict=bool(one.names)):
            body, other = bearer.setdefault(name, (one.body, link))
            if (body, other) != (one.body, link):
                raise SceneError(f"the name {quote(name)} is that of body {body}{link_words(other)}", "give another")
    return wanted


@contextmanager
def _naming_link(link: str, of: int) -> Iterator[None]:
    """Let errors of a link's mesh or modes name that link, one of ``of``, and a remedy."""
    try:
        yield
    except (MeshError, ModalError) as error:
        rest = "; or give another shape with mesh=" + (
            ", or add the other links one by one, by their names" if of > 1 else ""
        )
        what = error.what if error.what.startswith(f"{link} ") else f"{link}: {error.what}"
        raise type(error)(what, error.remedy + rest) from error


def outline_of(one: BodyRequest, part: int, known: dict[str, Outline]) -> ModalModel:
    """Return the surface of a link as a model without modes; of a plane, which has none, its model.

    known: surfaces of equal shapes, marbles by the thousand, which are united and cleaned but once.

    Raises
    ------
    MeshError
        It can be seen without filling it that the link cannot be filled.
    """
    from sonic_bullet import modal
    from sonic_bullet.modal.modal_analysis import solid_key

    label, shapes = one.parts[part]
    with _naming_link(label, len(one.parts)):
        if any(shape.kind == "plane" for shape in shapes):
            return _analyse_shapes(shapes, one)
        name = solid_key(shapes, one.options.thickness_m, None)
        surface = known.get(name) or modal.outline(shapes, one.options.thickness_m)
        known[name] = surface
    none = np.zeros(0)
    return ModalModel(
        none,
        none,
        np.zeros((len(surface.vertex_m), 3, 0)),
        surface.vertex_m,
        surface.face,
        np.zeros(len(surface.face)),
        surface.volume_m3,
        surface.volume_m3 * one.material.density_kg_m3,
        note="its modes were not solved, as nothing made it sound",
        includes_radiation=one.material.includes_radiation,
        assumed_wall_m=surface.assumed_wall_m,
        solution="none",
    )


def link_request(one: BodyRequest, part: int) -> BodyRequest:
    """Return the request for one of a body's links alone."""
    return replace(one, links=(one.links[part],), parts=(one.parts[part],), names=())


@show_progress()
def solved_links(wanted: Sequence[BodyRequest], known: Iterable[ModalModel], air: Air | None) -> list[ModalModel]:
    """Return the models of links, each with a request of its own (`link_request`), in their order.

    Parameters
    ----------
    known
        Models of bodies that are there already, shared by equal ones.
    air
        The medium; None: no sensor receives them.
    """
    from sonic_bullet.modal.modal_analysis import solid_key

    models: list[ModalModel] = []
    known_alike: dict[tuple[str, Material, str], ModalModel] = {}
    with one_thread(with_scipy=False), kept_meanwhile():  # models that are kept need no scipy
        made = _prepare(wanted, air)
        shared = list(known)
        for number, one in enumerate(wanted, start=1):
            ((name, shapes),) = one.parts
            head = f"modes of {name}" + (f", {number} of {len(wanted)}" if len(wanted) > 1 else "")
            if len(wanted) > 1:
                report_progress(head)
            with progress_under(head), _naming_link(name, 1):
                own = made.get(number - 1)
                alike = (solid_key(shapes, None, None), one.material, repr(one.options))
                if alike not in known_alike:  # else hundreds of equal bodies are read from the cache, one by one
                    known_alike[alike] = _share_model(_analyse_shapes(shapes, one) if own is None else own, shared)
                model = known_alike[alike]
            if air is not None and model.mode_count:
                report_progress(f"how {format_count(model.mode_count, 'mode')} of {name} radiate")
                with _naming_link(name, 1):
                    radiation_of(model, air)
            shared.append(model)
            models.append(model)
    return models


def enter_bodies(
    world: World,
    wanted: Sequence[BodyRequest],
    models: Sequence[Sequence[ModalModel]],
    asked: Sequence[BodyRequest],
) -> list[tuple[ModalModel, ...]]:
    """Add links with their models to the world; return the models of each body in ``asked``, in turn."""
    for one in wanted:  # all given names first, as default names are numbered
        for link, name in zip(one.links, one.names, strict=bool(one.names)):
            world.call(one.body, link, name)
    for one, mine in zip(wanted, models, strict=True):
        how: dict[str, Any] = {"material": one.material, "options": one.options if one.model is None else None}
        how |= {} if one.mounting is None else {"mounting": one.mounting}
        for link, (_, shapes), model in zip(one.links, one.parts, mine, strict=True):
            world.add(one.body, link, model=model, shapes=shapes, **how)
    for said in oversize_notes(wanted, models):
        warnings.warn(said, SizeWarning, stacklevel=4)  # where `Listener.add` was called
    each = chain.from_iterable(models)
    return [tuple(islice(each, len(one.links))) for one in asked]


def oversize_notes(wanted: Sequence[BodyRequest], models: Sequence[Sequence[ModalModel]]) -> Iterator[str]:
    """Yield a line for each link of a given model larger than anything that is struck to sound.

    Of others it was said before they were solved (`first_checks`).
    """
    for one, mine in zip(wanted, models, strict=True):
        for (name, _), model in zip(one.parts, mine, strict=True):
            if one.model is not None and (large := oversize(model.vertex_m, model.mass_kg)):
                yield f"{name} {large}; {SIZE_REMEDY}"


def cache_note(wanted: Sequence[BodyRequest], seconds: float) -> str | None:
    """Say once that computed models cannot be kept, and how long it took to compute these; None where all is well."""
    why = unreported_note() if any(one.model is None for one in wanted) else None
    if why is None:
        return None
    return (
        f"computed models are not kept ({why}): every run computes them anew, {seconds:.0f} s here; "
        "XDG_CACHE_HOME or SONIC_BULLET_CACHE names another folder"
    )


def _analyse_shapes(shapes: tuple[Shape, ...], one: BodyRequest) -> ModalModel:
    return analyse_body(shapes, one.material, **asdict(one.options))


def _share_model(model: ModalModel, known: Iterable[ModalModel]) -> ModalModel:
    """Return an equal model that a body has already, else the model: equal bodies share memory and derived data."""
    same = (
        other
        for other in known
        if (other.includes_radiation, other.solution) == (model.includes_radiation, model.solution)
        and all(
            np.array_equal(getattr(other, name), getattr(model, name))
            for name in ("freq_hz", "decay_per_s", "vertex_m", "face", "shape")
        )
    )
    return next(same, model)


def _prepare(wanted: Sequence[BodyRequest], air: Air | None) -> dict[int, ModalModel]:
    """Solve, side by side, for what the cache lacks of these links, and return the models by the links' numbers.

    Of equal ones the first is solved; failures are ignored here.
    """
    missing = _list_missing(wanted)

    def solve(number: int, one: BodyRequest) -> ModalModel | None:
        ((name, shapes),) = one.parts
        head = f"modes of {name}" + (f", {number} of {len(missing)}, two at a time" if len(missing) > 1 else "")
        with progress_under(head), suppress(SonicBulletError):
            model = _analyse_shapes(shapes, one)
            if air is not None and model.mode_count:
                report_progress("how they radiate")
                radiation_of(model, air)
            return model
        return None

    jobs = [partial(solve, i, wanted[place]) for i, place in enumerate(missing, start=1)]
    models = parallel_map(_call_job, jobs) if jobs else []
    return {place: model for place, model in zip(missing, models, strict=True) if model is not None}


def _call_job(job: Callable[[], ModalModel | None]) -> ModalModel | None:
    return job()


def _list_missing(wanted: Sequence[BodyRequest]) -> list[int]:
    """Return the numbers of the links whose modes are not cached, each once, in the order of the requests."""
    from sonic_bullet import modal

    found: dict[str, int] = {}
    for place, one in enumerate(wanted):
        ((_, shapes),) = one.parts
        key = modal.missing_name(shapes, one.material, one.options) if one.model is None else None
        if key is not None:
            found.setdefault(key, place)
    return list(found.values())
