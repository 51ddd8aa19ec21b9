"""One object under any elasticity: its tensor family (modal.tensor), struck and recorded as in the case.

    C/ρ -> λ (m,), ∂ ln λ/∂(C_k/ρ), J ψ (s, m)      cheap, for a search
        -> ModalModel, strikes and sensor last      as struck_bodies.modal_model makes them

The family is computed, or fetched from the cache, at its first use: most cases never need it.
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import replace
from functools import lru_cache

import numpy as np

from sonic_bullet.files.cases import Case, CaseRecording
from sonic_bullet.files.storage.cache import Place
from sonic_bullet.lab.diagnosis.prediction.struck_bodies import StruckBody, modal_model
from sonic_bullet.lab.effects.evidence import Elastic
from sonic_bullet.lab.fit.case_fit import CaseFit
from sonic_bullet.lab.fit.observation import direction_at
from sonic_bullet.lab.fit.recorded import guess_of
from sonic_bullet.modal import read_mesh
from sonic_bullet.modal.tensor import TensorFamily, tensor_family
from sonic_bullet.records import Array, Material, ModalModel


def with_elastic(
    found: CaseFit,
    bodies: tuple[StruckBody, ...],
    *,
    cache: Place = "default",
) -> tuple[StruckBody, ...]:
    """Make the bodies with a mesh able to take any elasticity.

    Parameters
    ----------
    found : CaseFit
        The fit.
    bodies : tuple of StruckBody
        The objects.
    cache : Place
        Where families are kept.
    """
    more = 1.6  # modes than the isotropic body has in the band: other tensors are softer somewhere
    made = []
    for body in bodies:
        if body.family is None:
            made.append(body)
            continue
        density = guess_of(found.case.objects[body.name]).density_kg_m3
        gamma, poisson = found.fit.gamma_m2_s2, found.fit.poisson_ratio
        material = Material.isotropic("fitted", youngs_pa=gamma * density, poisson=poisson, density_kg_m3=density)
        lines = len(body.recorded.lines.freq_hz) if body.recorded is not None else 0
        count = max(int(more * body.model.mode_count), round(1.2 * lines) + 8)
        made.append(
            replace(
                body,
                elastic=elastic_of(
                    found.case,
                    body.name,
                    body.recordings,
                    body.level_n_s,
                    material,
                    count,
                    cache=cache,
                ),
            )
        )
    return tuple(made)


def elastic_of(
    case: Case,
    name: str,
    recordings: tuple[CaseRecording, ...],
    level_n_s: Array,
    material: Material,
    count: int,
    *,
    cache: Place = "default",
) -> Elastic:
    """Make an object able to take any elasticity; raises SonicBulletError at its first use.

    Parameters
    ----------
    case : Case
        The case.
    name : str
        The object.
    recordings : tuple of CaseRecording
        Its strikes.
    level_n_s : (s,)
        Impulses, see `StruckBody`.
    material : Material
        Isotropic, as fitted.
    count : int
        Modes wanted.
    cache : Place
        Where families are kept.
    """
    kept = 12  # solved tensors
    thing = case.objects[name]

    modes = (30, 160)

    @lru_cache(maxsize=1)
    def family() -> TensorFamily:
        return tensor_family(
            read_mesh(thing.mesh or "", thing.scale),
            poisson=guess_of(thing).poisson,
            count=int(np.clip(count, *modes)),
            fixed=thing.fixed,
            cache=cache,
        )

    @lru_cache(maxsize=1)
    def rows() -> tuple[Array, Array | None]:
        """J φ·e of the strikes (s, 3b → b) and the sensor's row (b,), None where it has no place."""
        body = family().body
        strike = np.full((len(recordings), body.skin.shape[2]), np.nan)
        for i, r in enumerate(recordings):
            if r.position_m is not None:
                direction = direction_at(body, r.position_m, r.direction, inward=True)
                strike[i] = body.points(np.array([r.position_m]), direction[None])[0][0] * level_n_s[i]
        at, along = (None if spots is None else spots.get(name) for spots in (case.sensor_m, case.sensor_direction))
        if case.sensor != "velocity" or at is None:
            return strike, None
        direction = direction_at(body, at, along, inward=False)
        return strike, body.points(np.array([at]), direction[None])[0][0]

    def look(stiffness_m2_s2: Array) -> tuple[Array, Callable[[Array], Array], Array]:
        value, vector = family().modes(stiffness_m2_s2)
        strike, sensor = rows()
        push = strike @ vector if np.isfinite(strike).any() else np.full((len(strike), len(value)), np.nan)
        observed = push * (sensor @ vector if sensor is not None else 1.0)
        return np.sqrt(value) / (2 * np.pi), lambda mode: family().slopes(vector[:, mode], value[mode]), observed

    @lru_cache(maxsize=kept)
    def solved(content: bytes) -> ModalModel:
        value, vector = family().modes(np.frombuffer(content).reshape(6, 6))
        low = np.sqrt(value) / (2 * np.pi) < 1.02 * case.band_hz[1]
        return modal_model(case, name, recordings, family().body, material.density_kg_m3, value[low], vector[:, low])[0]

    return Elastic(
        material,
        case.onset_s is not None and case.sensor in ("velocity", "sum"),
        look,
        lambda stiffness: solved(np.ascontiguousarray(stiffness, float).tobytes()),
    )
