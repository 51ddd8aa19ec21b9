"""A strike as the material plays it that was guessed before anybody listened: what a shipped preset is worth here.

    (E/ρ, ν, α, β) of the guess -> modes of the object's shape -> A = ψ(place) w, d = ½(α + βλ)
        no place known: the root mean square of ψ over the surface

α and β of a guess without them are those of the table's preset whose E/ρ and ρ are nearest, by ratio. A damping law of
the guess takes their place.
"""

from __future__ import annotations

import numpy as np

from sonic_bullet.effects.damping_law import own_decay_per_s
from sonic_bullet.files.cases import CaseRecording
from sonic_bullet.files.presets import load_material, table_names
from sonic_bullet.lab.fit.case_fit import CaseFit
from sonic_bullet.lab.fit.prediction_of_lines import damped_sum
from sonic_bullet.lab.fit.recorded import RecordedObject, describe_observation
from sonic_bullet.records import Array, Material


def with_shipped_damping(guess: Material) -> Material:
    """Return the guess, or where it has no damping the isotropic preset of a table that is nearest to it."""
    if guess.alpha_per_s is not None and guess.beta_s is not None:
        return guess
    own = np.log([guess.youngs_pa / guess.density_kg_m3, guess.density_kg_m3])
    shipped = [m for name in table_names() if (m := load_material(name)).youngs_pa and m.beta_s is not None]
    return min(
        shipped,
        key=lambda m: float(((np.log([m.youngs_pa / m.density_kg_m3, m.density_kg_m3]) - own) ** 2).sum()),
    )


def plausible_sound(found: CaseFit, e: RecordedObject, recording: CaseRecording, n: int, sr: int) -> Array | None:
    """Play a take (n,) by the guess, at no level of its own; None of an object without a mesh.

    Raises MeshError where the strike lies off the surface.
    """
    if e.family is None:
        return None
    guess, shipped = e.guess, with_shipped_damping(e.guess)
    value, vector = e.family.modes(guess.youngs_pa / guess.density_kg_m3, guess.poisson)
    decay = own_decay_per_s(shipped, value)
    band = found.case.band_hz[0], min(found.case.band_hz[1], sr / 2)
    freq = np.sqrt(np.maximum(value - decay**2, 0)) / (2 * np.pi)
    seen = describe_observation(found.case, e.thing, guess, (recording,), e.family)
    weight = _sensor_weight(found, e, len(value))
    if recording.position_m is not None:
        size = seen.transfer(vector, weight)[0]
    else:
        skin = np.einsum("vxb,bm->vxm", e.family.skin, vector)
        size = weight * np.sqrt((skin**2).sum(axis=1).mean(axis=0))
    use = (freq >= band[0]) & (freq < band[1]) & np.isfinite(size)
    return damped_sum(freq[use], decay[use], (size * seen.start(np.maximum(freq, 1e-9), decay))[use], n, sr)


def _sensor_weight(found: CaseFit, e: RecordedObject, count: int) -> Array:
    """Return what a microphone takes of each mode (m,), as the fit has it; the middle one of modes it does not hold.

    Shapes hardly change with the material.
    """
    o = next((o for o in found.objects if o.evidence.thing.name == e.thing.name), None)
    if o is None or not len(o.sensor_weight):
        return np.ones(count)
    weight = np.full(count, float(np.median(o.sensor_weight)))
    for one, members in zip(o.sensor_weight, o.member, strict=True):
        weight[members[members < count]] = one
    return weight
