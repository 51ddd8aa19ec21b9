"""What an object's modes lose to the air, as the run time has it, so that a fit of the material leaves it out.

    d_line = ½(α + βλ) + Δd
        Δd: radiation.far_field, in the air that the run time plays in (engine/bank/resonator.py), of the modes on the
        family's surface, which follows their waves as the run time's own does (modal/methods.py makes both)

Modes that count as one line: their mean, weighted by the squares of what the strikes let the sensor
hear of each.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from sonic_bullet.files.cases import Case
from sonic_bullet.lab.fit.case_fit import RadiationIn
from sonic_bullet.lab.fit.pairing import Group, group_modes
from sonic_bullet.lab.fit.recorded import RecordedObject
from sonic_bullet.modal.isotropic_family import Family
from sonic_bullet.radiation.far_field import radiation
from sonic_bullet.records import Air, Array, ModalModel


@dataclass(frozen=True, slots=True, eq=False)
class GroupRadiation:
    """What each group of an object's modes (m,), as `group_modes` has them, radiates; NaN above the band.

    weight: |pressure| at 1 m per modal velocity. extra_per_s: radiation damping in 1/s.
    """

    weight: Array
    extra_per_s: Array


def without_radiation(group: Group) -> GroupRadiation:
    """Where neither the sensor nor the fit asks for the air."""
    return GroupRadiation(np.ones(len(group.freq_hz)), np.zeros(len(group.freq_hz)))


def radiation_in(case: Case, evidence: tuple[RecordedObject, ...]) -> RadiationIn:
    """Say whether the material's own damping can be separated from what the air takes.

    It can where nothing is lost to a medium, or the medium is known, and so are all shapes.
    """
    if case.medium == "none":
        return "nothing"
    return "apart" if case.medium == "air" and all(e.family is not None for e in evidence) else "damping"


def in_air(e: RecordedObject, log_gamma: float, poisson: float, to_hz: float, apart: bool) -> GroupRadiation | None:
    """Return what an object's modes at (γ, ν) and the guess's density, those up to to_hz, radiate.

    None where neither its sensor nor the fit asks for the air. apart: radiation is no part of the material's damping.
    """
    beyond = 1.03  # of a band's end: modes that a line within it may be paired with
    assert e.family is not None and e.seen is not None
    if not apart and e.seen.kind != "pressure":
        return None
    group = group_modes(e.family, e.seen, log_gamma, poisson)
    value, vector = e.family.modes(float(np.exp(log_gamma)), poisson)
    freq = np.sqrt(value) / (2 * np.pi)
    m = int((freq < beyond * to_hz).sum())
    weight, extra = np.full(len(freq), np.nan), np.full(len(freq), np.nan)
    weight[:m], extra[:m] = into_air(e.family, e.guess.density_kg_m3, freq[:m], vector[:, :m])
    observed = np.nan_to_num((e.seen.transfer(vector) ** 2).sum(axis=0))
    observed = observed * weight**2 if e.seen.kind == "pressure" else observed
    first = np.array([who[0] for who in group.member], int)
    mean = np.array([_mean(extra[who], observed[who]) for who in group.member])
    return GroupRadiation(weight[first], mean)


def _mean(value: Array, weight: Array) -> float:
    return float(np.average(value, weights=weight)) if weight.sum() > 0 else float(value.mean())


def into_air(
    family: Family,
    density_kg_m3: float,
    freq_hz: Array,
    vector: Array,
    air: Air | None = None,
) -> tuple[Array, Array]:
    """|w| (m,) in Pa·m per modal velocity and Δd (m,) in 1/s of modes (b, m) of the family, freq_hz (m,) ascending.

    Source: `radiation.far_field`.
    """
    shape = np.einsum("vxb,bm->vxm", family.skin, vector.astype(np.float32)) / np.float32(
        np.sqrt(density_kg_m3 * family.length_m**3)
    )
    mass = family.volume_m3 * density_kg_m3
    weight, extra = radiation(
        ModalModel(
            freq_hz,
            np.zeros(len(freq_hz)),
            shape,
            family.vertex_m,
            family.face,
            np.zeros(len(family.face)),
            family.volume_m3,
            mass,
        ),
        air or Air(),
    )
    return np.abs(weight), extra
