"""Preset of a diagnosis: the fitted material, with the effects that belong to it and its object.

Stiffness that depends on direction becomes the preset's elasticity; what belongs to fixture, striker, room and chain
stays with the case. A diagnosis uses total decays, until it names radiation: then α and β, or the law in their place,
are the rest, and the run time adds its own radiation.
"""

from __future__ import annotations

import msgspec

from sonic_bullet.effects.presets_of_effects import KEPT_EFFECTS, to_preset
from sonic_bullet.effects.protocol import Effect, Owner, Stage
from sonic_bullet.effects.radiation import Radiation
from sonic_bullet.files.presets import Elasticity, Preset, material_of
from sonic_bullet.lab.diagnosis.diagnose import Diagnosis
from sonic_bullet.lab.fit.fitted_preset import preset_of as fitted_preset


def preset_of(d: Diagnosis) -> Preset:
    """Build the preset of a diagnosis."""
    base = fitted_preset(d.found)
    after = d.closed.after
    total = d.found.radiation == "damping" and not any(isinstance(e, Radiation) for e in after.effects)
    damping = msgspec.structs.replace(
        base.damping, alpha_per_s=max(after.alpha_per_s, 0.0), beta_s=max(after.beta_s, 0.0), includes_radiation=total
    )
    assert base.provenance is not None
    provenance = msgspec.structs.replace(
        base.provenance,
        method=f"{base.provenance.method}; effects by cross-validation on strikes left out",
        verdict=d.verdict,
    )
    # recorded lines stand in place of all modes
    effects = (*(to_preset(e) for e in after.effects if is_exported(e)), *base.effects)
    made = msgspec.structs.replace(base, damping=damping, provenance=provenance, effects=effects)
    for effect in after.effects:
        if effect.stage is Stage.MATERIAL:
            stiffness = effect.apply(material_of(base)).stiffness_pa
            rows = tuple(tuple(float(x) for x in row) for row in stiffness)
            stated = Elasticity(
                stiffness_pa=rows,  # type: ignore[arg-type]
                source=base.elasticity.source,
                note="diagnosed: " + effect.id,
            )
            made = msgspec.structs.replace(made, elasticity=stated)
    return made


def is_exported(effect: Effect) -> bool:
    """Decide whether a preset holds the effect."""
    return effect.owner in (Owner.MATERIAL, Owner.OBJECT) and isinstance(effect, KEPT_EFFECTS)
