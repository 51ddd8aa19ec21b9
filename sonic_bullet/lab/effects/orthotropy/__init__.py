"""How `orthotropy` is looked for.

Identified by all lines, whatever isotropic modes they were paired with (tensor_search.py); None where isotropy does as
well. Density is the guess's: modes depend on C/ρ alone.
"""

from __future__ import annotations

import numpy as np

from sonic_bullet.effects.orthotropy import Orthotropy
from sonic_bullet.lab.effects.evidence import Evidence, ObjectEvidence
from sonic_bullet.lab.effects.orthotropy.tensor_lines import LINE_CAP, body_lines_of, select_ringing, weigh_lines
from sonic_bullet.lab.effects.orthotropy.tensor_search import Tensor, fit_tensor, isotropic_p, search
from sonic_bullet.lab.effects.orthotropy.tensors import TENSOR_WIDTHS, isotropic_shear, p_of
from sonic_bullet.records import ORTHOTROPIC


def orthotropy_of(tensor: Tensor, density_kg_m3: float) -> Orthotropy:
    """Build the effect from a fitted tensor and a density."""
    stiff = tensor.stiffness_m2_s2 * density_kg_m3
    return Orthotropy(tuple(float(stiff[i, j]) for i, j in ORTHOTROPIC), tensor.symmetry, tensor.held)


def propose_orthotropy(evidence: Evidence) -> Orthotropy | None:
    """Search for the tensor that explains all lines best; None where isotropy does as well."""
    # or in BIC, with a line more within the cap: half of those in a room are no modes, and beyond it whatever the
    # tensor
    in_a_room = 30.0
    least = 0.03  # of ln E_i/E_j or ln of Zener's ratio: less is the mesh's
    nearer = 0.7  # of isotropy's rms of ln f, lines beyond the cap counted at the cap
    better = 10.0  # in BIC, than isotropy
    bodies = body_lines_of(evidence)
    if isinstance(evidence.known, Orthotropy) and bodies:
        density = bodies[0].elastic.material.density_kg_m3
        start = p_of(evidence.known.stiffness_pa / density)
        return orthotropy_of(
            fit_tensor(bodies, evidence.known.symmetry, start, isotropic_p(bodies[0].elastic), TENSOR_WIDTHS[4:]),
            density,
        )
    lines = sum(len(t.log_hz) for t in bodies)
    if lines < 6 or all(_fits(h) for h in evidence.observed):
        return None
    found = search(evidence)
    if found is None:
        return None
    plain, best = found
    gain, dry = plain.bic - best.bic, any(h.dry for h in evidence.observed)
    anisotropic = gain > better and best.off < nearer * plain.off
    anisotropic |= dry and gain > in_a_room and round(lines * (best.matched - plain.matched)) >= 1
    if not anisotropic or departure(best) < least:
        return None
    return orthotropy_of(best, bodies[0].elastic.material.density_kg_m3)


def departure(tensor: Tensor) -> float:
    """Compute the distance from isotropy: the largest of |ln E_i/E_j| and |ln G_ij/(√(E_i E_j)/2(1+n_ij))|."""
    p = tensor.p
    return float(max(np.ptp(p[:3]), np.abs(p[6:] - isotropic_shear(p)).max()))


def _fits(h: ObjectEvidence) -> bool:
    """Decide whether the isotropic body's modes are where the lines are."""
    # rms of ln f from the nearest isotropic mode that leaves nothing to look for: split pairs, corrected meshes
    suffices = 5e-3
    if not len(h.freq_hz):
        return False
    off, own = np.log(h.freq_hz / h.model_hz), select_ringing(h)
    shift = float(np.median(off))
    left = np.minimum(np.abs(off - shift), LINE_CAP)
    if own.any():
        model = h.plain or h.model
        modes = model.freq_hz if model is not None else h.all_hz
        strange = np.abs(np.log(h.foreign_hz[own][:, None] / modes[None, :]) - shift).min(axis=1)
        left = np.concatenate([left, np.minimum(strange, LINE_CAP)])
    worth = weigh_lines(np.concatenate([h.amplitude, h.foreign_amplitude[:, own]], axis=1))
    return bool(np.sqrt((worth * left**2).sum() / worth.sum()) < suffices)
