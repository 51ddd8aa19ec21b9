"""Effects in presets and in the run time: a material's or an object's effects act in every scene.

{"id": …, fields} <-> Effect;   Material.effects -> MATERIAL before the modes are solved, MODES after, BANK in the bank
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import fields, replace
from typing import Any

import msgspec
import numpy as np

from sonic_bullet.effects.amplitude_damping import AmplitudeDamping
from sonic_bullet.effects.amplitude_pitch import AmplitudePitch
from sonic_bullet.effects.damping_law import DampingLaw
from sonic_bullet.effects.damping_law.thermoelastic import ThermoelasticLoss
from sonic_bullet.effects.mode_splitting import ModeSplitting
from sonic_bullet.effects.protocol import Effect, Ring, RotatesPairs, Stage
from sonic_bullet.effects.recorded_lines import RecordedLines
from sonic_bullet.records import Material, ModalModel
from sonic_bullet.records.coerce import nearest, quote
from sonic_bullet.records.errors import MaterialError, RecordError

KEPT_EFFECTS: tuple[type[Effect], ...] = (
    DampingLaw,
    ThermoelasticLoss,
    ModeSplitting,
    AmplitudePitch,
    AmplitudeDamping,
    RecordedLines,
)
"""Effects that a preset may hold, and a log.

A stiffness that depends on direction is the preset's own elasticity; radiation is the run time's own.
"""


FILE_NAMES = {"damping_growth": "choke"}
"""Fields whose name in a preset file is another: files written before keep their meaning."""


def to_preset(effect: Effect) -> dict[str, Any]:
    """Return an effect as a preset file holds it: its fields without undefined numbers (NaN)."""
    values = {FILE_NAMES.get(name, name): value for name, value in msgspec.to_builtins(effect).items()}
    return {"id": effect.id} | {
        name: value for name, value in values.items() if not (isinstance(value, float) and np.isnan(value))
    }


def effect_of(data: dict[str, Any]) -> Effect:
    """Build an effect from what `to_preset` returned.

    Raises
    ------
    RecordError
        There is no such effect, or a field is wrong; names it.
    """
    name = data.get("id")
    kind = next((k for k in KEPT_EFFECTS if k.id == name), None)
    if kind is None:
        raise RecordError(
            f"there is no effect '{name}' that a preset can hold", f"use one of {', '.join(k.id for k in KEPT_EFFECTS)}"
        )
    field_of = {FILE_NAMES.get(one.name, one.name): one.name for one in fields(kind)}  # type: ignore[arg-type]
    for key in data:
        if key != "id" and key not in field_of:
            raise RecordError(f"effect '{name}': field {quote(key)} is not known", nearest(key, list(field_of)))
    try:
        made: Effect = msgspec.convert({field_of[k]: v for k, v in data.items() if k != "id"}, kind)
    except msgspec.ValidationError as error:
        raise RecordError(f"effect '{name}': {error}", "mend that field") from error
    except RecordError as error:
        raise RecordError(f"effect '{name}': {error.what}", error.remedy) from error
    return made


def check_effects(material: Material) -> None:
    """Raise MaterialError where a material has an effect that no scene plays, or something else in its place."""
    # stages at which a material's effects act, in this order: the others belong to a strike or to a recording
    played_stages = (Stage.MATERIAL, Stage.MODES, Stage.BANK)
    for number, effect in enumerate(material.effects):
        where = f"material '{material.name}': effects[{number}]"
        remedy = "give effects of sonic_bullet.effects"
        if isinstance(effect, type):  # the kind in place of one of them, which has a stage as well
            raise MaterialError(f"{where} is {quote(effect)}", remedy)
        try:
            stage = effect.stage
        except AttributeError:
            raise MaterialError(f"{where} is {quote(effect)}", remedy) from None
        if stage not in played_stages:
            raise MaterialError(
                f"{where}, {quote(effect)}, belongs to a strike or a recording, not to a body", "leave it out"
            )


def with_material(material: Material) -> Material:
    """Apply a material's effects on stiffness and density to it."""
    for effect in of_stage(material, Stage.MATERIAL):
        material = replace(effect.apply(material), effects=material.effects)
    return material


def with_modes(model: ModalModel, material: Material) -> ModalModel:
    """Apply a material's effects on modes to a body's model, and those on how the modes depend on their level.

    Bend and damping growth are per peak velocity at the surface. Where a level was measured as an impulse, the velocity
    is what that impulse causes at a typical place (rms over the surface).
    """
    if not model.mode_count:
        return model
    for effect in of_stage(material, Stage.MODES):
        model = effect.apply(model)
    effects = of_stage(material, Stage.BANK)
    if not effects:
        return model
    for effect in effects:
        if isinstance(effect, RotatesPairs):
            model = effect.turn_pairs(model)
    square = (model.shape.astype(float) ** 2).sum(axis=1)
    level = np.sqrt(square.mean(axis=0) / 3 * square.max(axis=0))
    none = np.zeros(model.mode_count)
    ring = Ring(model.freq_hz, model.decay_per_s, none, level, none, none)
    for effect in effects:
        ring = effect.apply(ring)
    return replace(
        model,
        bend_s2_m2=ring.bend,
        damping_growth_s_m=ring.damping_growth,
        damping_growth_power=ring.damping_growth_power,
    )


def needs_exact_shapes(material: Material) -> bool:
    """Tell whether a material's effects on modes derive something from their shapes, before these are rounded."""
    return any(isinstance(effect, ThermoelasticLoss) for effect in material.effects)


def of_stage(material: Material, stage: Stage) -> Sequence[Effect]:
    """Return a material's effects of a stage."""
    return [e for e in material.effects if e.stage is stage]
