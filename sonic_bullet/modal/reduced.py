"""Reduced basis of a body for all isotropic materials: its modes at two Poisson's ratios span those between.

    K(E, ν) = E [ l(ν) K_l + s(ν) K_s ],   l = ν/((1+ν)(1−2ν)),  s = 1/(2(1+ν))
        [Hughes 1987, ch. 2.7]
    V: modes at ν₁ and ν₂ together, VᵀMV = 1;   (l VᵀK_lV + s VᵀK_sV) q = θ q,  λ = γ θ/L²,  γ = E/ρ     [Rayleigh-Ritz]

They span those a little beyond as well. The error of λ is of the fourth order in the distances from ν₁ and ν₂. Lengths
by the body's diagonal L, as in modal_analysis.py. The method for the modes at both is that of `analyse` (methods.py).
"""

from __future__ import annotations

from collections.abc import Callable

import numpy as np

from sonic_bullet.files.storage import cache as store
from sonic_bullet.machine.parallel import one_thread
from sonic_bullet.modal.isotropic_family import Family, mix_stiffness
from sonic_bullet.modal.kept_solids import pack_touched, unpack_touched
from sonic_bullet.modal.keys import key
from sonic_bullet.modal.methods import choose_method, refine_until_accurate
from sonic_bullet.modal.modal_analysis import diagonal_m, solid_key
from sonic_bullet.modal.sectors import MOST_MODES, ModalMethod, WantedModes
from sonic_bullet.records import Array, Shape
from sonic_bullet.records.errors import ModalError


@one_thread()
def family(
    shape: Shape,
    *,
    gamma_m2_s2: float,
    poisson: float,
    to_hz: float,
    fixed: tuple[tuple[float, float, float, float], ...] = (),
    edge_m: float | None = None,
    cache: store.Place = "default",
) -> Family:
    """Build the family of one body about a guess, its modes true up to to_hz at the guessed γ.

    fixed, edge_m, cache: as in `analyse`. Raises MeshError, ModalError.
    """
    beyond = 1.1  # × the limit on λ: a mode above it at one ν may lie below it at the other
    length = diagonal_m((shape,))
    limit = (2 * np.pi * to_hz) ** 2 * length**2 / gamma_m2_s2
    clamp = np.array(fixed, float).reshape(-1, 4)
    name = key("family", solid_key((shape,), None, edge_m), clamp, poisson, limit)
    found = store.load(cache, name)
    if found is not None:
        a, note = found
        volume, count, meshed, error = a["numbers"]
        return Family(
            a["lame"],
            a["shear"],
            a["skin"],
            a["vertex"],
            a["face"],
            length,
            float(volume),
            int(count),
            note,
            bool(meshed),
            float(error) if error >= 0 else np.nan,
            a["curvature"],
            unpack_touched(a),
        )
    kept = (cache, solid_key((shape,), None, edge_m))
    low, high = _poissons(poisson)
    wanted = WantedModes(limit, MOST_MODES, beyond)
    method = choose_method(
        (shape,),
        length,
        mix_stiffness(max(low, high), *_lame_shear()),
        wanted,
        clamp=clamp,
        edge_m=edge_m,
        thickness_m=None,
        kept=kept,
    )
    made = _build_family(method, length, wanted, (low, high))
    # the cache holds finite numbers: -1 is an unknown error
    numbers = np.array([made.volume_m3, made.count, made.meshed, np.nan_to_num(made.error, nan=-1.0)])
    arrays = {
        "lame": made.lame,
        "shear": made.shear,
        "skin": made.skin,
        "vertex": made.vertex_m,
        "face": made.face,
        "curvature": made.curvature_per_m,
        **pack_touched(made.touched),
        "numbers": numbers,
    }
    store.save(cache, name, arrays, made.note)
    return made


def _poissons(poisson: float) -> tuple[float, float]:
    apart_poisson = 0.05  # of ν₁ and ν₂ from the guess
    poisson_range = (-0.5, 0.485)
    low, high = (float(np.clip(poisson + apart, *poisson_range)) for apart in (-apart_poisson, apart_poisson))
    if high - low < apart_poisson / 2:
        raise ModalError(f"Poisson's ratio {poisson} is no isotropic solid's", "guess one between -0.5 and 0.48")
    return low, high


def _together(first: Array, second: Array, mass: Callable[[Array], Array]) -> Array:
    """Return columns (n, b) with VᵀMV = 1 that span those of both, the first's first."""
    rest = second - first @ (first.T @ mass(second))
    rest -= first @ (first.T @ mass(rest))
    value, turn = np.linalg.eigh(rest.T @ mass(rest))
    good = value > 1e-12
    return np.concatenate([first, rest @ (turn[:, good] / np.sqrt(value[good]))], axis=1)


def _lame_shear() -> tuple[Array, Array]:
    lame, shear = np.zeros((6, 6)), np.diag([2.0, 2, 2, 1, 1, 1])
    lame[:3, :3] = 1
    return lame, shear


def _build_family(method: ModalMethod, length: float, wanted: WantedModes, poisson: tuple[float, float]) -> Family:
    """Build the family that the modes at two Poisson's ratios span, sector by sector."""
    accuracy = 0.01  # of the highest mode's frequency: as `analyse` has it by default
    from scipy.linalg import block_diag

    tensors = [np.asarray(mix_stiffness(nu, *_lame_shear())) for nu in poisson]
    while True:  # until there is a mode
        method, sectors, _, _, error = refine_until_accurate(method, tensors, wanted, accuracy)
        sectors = [sector for sector in sectors if any(len(value) for value, _ in sector.found)]
        if sectors:
            break
        wanted = wanted._replace(limit=4 * wanted.limit)
    share = np.linalg.inv(
        [[mix_stiffness(nu, 1.0, 0.0), mix_stiffness(nu, 0.0, 1.0)] for nu in poisson]
    )  # of K at both ν in K_l, K_s
    bases, lame, shear = [], [], []
    for sector in sectors:
        (value, first), (_, second) = sector.found
        basis = _together(first, second, lambda v, sector=sector: sector.mass @ v)  # type: ignore[misc]
        bases.append(basis)
        parts = np.array([basis.T @ (stiff @ basis) for stiff in sector.stiff])
        # a method may correct λ for its elements' error: K is scaled alike, other motions by the modes' mean
        off = np.sqrt(value / np.diagonal(parts[0])[: len(value)])
        off = np.append(off, np.full(len(basis.T) - len(off), off.mean() if len(off) else 1.0))
        whole = np.tensordot(share, parts * np.outer(off, off), 1)
        whole = (whole + whole.transpose(0, 2, 1)) / 2
        lame += [whole[0]] * sector.multiplicity
        shear += [whole[1]] * sector.multiplicity
    surface = method.evaluate_on_surface(sectors, bases)
    counts = [
        sum(int((sector.found[k][0] <= wanted.limit).sum()) * sector.multiplicity for sector in sectors) for k in (0, 1)
    ]
    return Family(
        block_diag(*lame),
        block_diag(*shear),
        surface.shape,
        surface.vertex_m,
        surface.face,
        length,
        method.volume * length**3,
        min(MOST_MODES, *counts),
        f"{method.note(sectors)}; nu {poisson[0]:g} and {poisson[1]:g}",
        method.meshed,
        error,
        surface.curvature_per_m,
        surface.touched,
    )
