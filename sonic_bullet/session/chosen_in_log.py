"""A log with other materials: motion and contacts stay as recorded, modes are computed anew.

ContactLog + MaterialChoice -> each body's surface, from its model in the log -> modes of the other material
    -> ContactLog
"""

from __future__ import annotations

from dataclasses import asdict, replace

from sonic_bullet.effects.presets_of_effects import with_material
from sonic_bullet.files.contact_log import ContactLog
from sonic_bullet.machine.progress import report_progress
from sonic_bullet.records import Body, Material, ModalModel, Shape
from sonic_bullet.records.errors import LogError, MeshError, ModalError
from sonic_bullet.records.modal_options import ModalOptions
from sonic_bullet.session.body_models import analyse_body
from sonic_bullet.session.material_choice import MaterialChoice


def with_choice(log: ContactLog, choice: MaterialChoice, where: str) -> tuple[ContactLog, tuple[str, ...]]:
    """Return the log with its bodies made of the chosen materials, and silent where chosen, and notes for the user.

    Modes are those of the body's surface in the log, clamped and counted as before.

    Parameters
    ----------
    where
        Name of the log in errors.

    Raises
    ------
    SceneError
        No body has one of the names.
    LogError
        The log does not hold the shape of a body that is to sound, or modes are to be filled in.
    MeshError, ModalError
        As `modal.analyse` does, naming the body.
    """
    as_recorded = "motion, masses and contact forces stay as the log recorded them"
    if not choice:
        return log, ()
    if choice.fill_modes:
        raise LogError(
            f"{where} holds modes, and no law of damping above them",
            "render its scene with --fill-modes and --contacts: that log keeps them",
        )
    if choice.draft:
        raise LogError(
            f"{where} holds modes, so it needs no draft",
            "render its scene with --draft and --contacts: that log keeps them",
        )
    choice.check_names([body.name for body in log.bodies], where)
    solved: dict[tuple[int, int, str], ModalModel] = {}
    bodies, changed = [], {}
    for body in log.bodies:
        silent = body.silent or choice.is_silent(body.name)
        material = choice.material_of(body.name)
        if material is not None and (body.material is not None or choice.names(body.name)):
            changed[body.name] = material.name
            bodies.append(replace(_made_of(body, material, where, solved), silent=silent))
        else:
            bodies.append(replace(body, silent=silent))
    idle = choice.silent_notes(body for body in log.bodies if not body.silent)
    said = ", ".join(f"{name} is {of}" for name, of in changed.items())
    return replace(log, bodies=tuple(bodies)), (*((f"{said}: {as_recorded}",) if changed else ()), *idle)


def _made_of(body: Body, chosen: Material, where: str, solved: dict[tuple[int, int, str], ModalModel]) -> Body:
    material = with_material(chosen)
    if body.material is None:
        raise LogError(
            f"{where} does not hold the shape of {body.name}, which was no sounding body when it was recorded",
            f"render the scene with --material {body.name}=… instead",
        )
    if body.model is None or not len(body.model.face):  # ground: its material acts in contacts alone
        return replace(body, material=material)
    if body.model.unsolved:
        mass = body.model.volume_m3 * material.density_kg_m3
        return replace(body, material=material, model=replace(body.model, mass_kg=mass))
    key = id(body.model), id(chosen), repr(body.options)
    if key not in solved:
        report_progress(f"modes of {body.name} in {chosen.name}")
        # the surface is that of the solid, whatever wall an open one was given
        options = asdict(replace(body.options or ModalOptions(), thickness_m=None))
        surface = Shape("mesh", vertex_m=body.model.vertex_m, face=body.model.face)
        try:
            solved[key] = analyse_body((surface,), material, **options)
        except (MeshError, ModalError) as error:
            raise type(error)(f"{body.name}: {error.what}", error.remedy) from error
    return replace(body, material=material, model=solved[key])
