"""From modal velocity to pressure: how well each mode of a compact body radiates, and what that costs it.

    A = ∮(φ·n)² dS = A0 + A1 + A2                                          the shape's normal motion in three orthogonal parts:
    A0 = Q²/S, Q = ∮φ·n dS                      monopole: net volume flow   σ0 = x²/(1 + x²)              [Pierce 1989, eq. 4-1.4]
    A1 = bᵀN⁻¹b, b = ∮n φ·n dS, N = ∮n nᵀ dS    dipole: like a rigid shift  σ1 = x⁴/(4 + x⁴)              [Pierce 1989, eq. 4-2.13]
    A2 = A - A0 - A1                            quadrupole and beyond       σ2 = x⁶/(81 + 9x² - 2x⁴ + x⁶)
    σA = σ0 A0 + σ1 A1 + σ2 A2,   x = ka,  a = √(S/4π),  k = ω/c
    |p| at 1 m per modal velocity = ρ₀c √(σA/4π)          mean over directions   [power = ρ₀c σA <q̇²> = 4π <p²>/ρ₀c]
    Δd = ½ ρ₀c σA                                         power = 2 Δd · ½|z|², the modal energy (mass-normalised)

σ_l = 1/(x² |h_l'(x)|²) are those of a sphere that moves as the harmonic l [Junger & Feit 1986, sec. 2.11; Williams 1999, eq. 6.122],
so spheres are exact to l = 2. Q radiates ρ₀ck²Q²/4π for any compact body: σ0·Q²/S is exact at small ka whatever the form. The dipole
takes the body's added mass for a sphere's (a flat disc gets 3.2 dB too much). What is beyond l = 2 radiates less at small ka than A2 says.

The weight is complex. Its phase is that of the sphere's law for the part that leads (monopole: ix/(1+ix), so that the pressure follows
acceleration at small ka), its sign follows the mode's: a shape and its negative sound the same.
v vertices, f faces, m modes.
"""

from __future__ import annotations

import numpy as np

from sonic_bullet.records import Air, Array, ModalModel

_MODES_AT_ONCE = 32


def radiation(model: ModalModel, air: Air) -> tuple[Array, Array]:
    """Pressure weight (m,) complex, in Pa·m per modal velocity (m/s·√kg), and radiation damping (m,) in 1/s.

    Pressure at distance r is Re(weight·z)/r, z the modal state of `bank`. Zero for a model without a surface. Source: the module's equations.
    """
    omega = 2 * np.pi * model.freq_hz
    area, parts, sign = surface_motion(model)
    if area == 0:
        return np.zeros(len(omega), complex), np.zeros(len(omega))
    impedance = air.density_kg_m3 * air.sound_speed_m_s
    x = omega / air.sound_speed_m_s * np.sqrt(area / (4 * np.pi))
    power = efficiency(x) * parts
    total = power.sum(axis=0)
    weight = impedance * np.sqrt(total / (4 * np.pi)) * sign * _phase(x, power)
    return np.asarray(weight), np.asarray(0.5 * impedance * total)


def efficiency(ka: Array) -> Array:
    """Radiation efficiencies σ (3, m) of monopole, dipole and quadrupole at ka (m,). Source: the module's equations."""
    x2 = np.asarray(ka, float) ** 2
    return np.stack([x2 / (1 + x2), x2**2 / (4 + x2**2), x2**3 / (81 + 9 * x2 - 2 * x2**2 + x2**3)])


def surface_motion(model: ModalModel) -> tuple[float, Array, Array]:
    """Area S in m², the parts A0, A1, A2 (3, m) in m²/kg of each mode's normal motion, and its sign (m,).

    Exact for shapes linear in each triangle. The sign is that of Q where a part of the motion has net flow, else of ∮(φ·n)³dS.
    """
    corner = model.vertex_m[model.face]
    twice = np.cross(corner[:, 1] - corner[:, 0], corner[:, 2] - corner[:, 0])
    length = np.linalg.norm(twice, axis=1)
    face, twice, length = model.face[length > 0], twice[length > 0], length[length > 0]
    m = model.mode_count
    area = length / 2
    surface = float(area.sum())
    parts, sign = np.zeros((3, m)), np.ones(m)
    if surface == 0 or m == 0:
        return 0.0 if m == 0 or surface == 0 else surface, parts, sign
    normal = twice / length[:, None]
    inverse = np.linalg.pinv(np.einsum("f,fi,fj->ij", area, normal, normal), rcond=1e-9, hermitian=True)
    for lo in range(0, m, _MODES_AT_ONCE):
        some = slice(lo, min(lo + _MODES_AT_ONCE, m))
        shape = model.shape[:, :, some].astype(float)
        speed = np.einsum("fi,fcim->fcm", normal, shape[face])  # normal speed at the corners
        mean = speed.mean(axis=1)
        # ∫uv over a triangle of linear u, v = area/12 (Σu Σv + Σuv)
        square = area @ ((3 * mean) ** 2 + (speed**2).sum(axis=1)) / 12
        flow = area @ mean
        shift = normal.T @ (area[:, None] * mean)
        cube = area @ mean**3
        monopole = flow**2 / surface
        dipole = np.einsum("im,ij,jm->m", shift, inverse, shift)
        dipole = np.minimum(dipole, np.maximum(square - monopole, 0))
        parts[:, some] = monopole, dipole, np.maximum(square - monopole - dipole, 0)
        flows = np.abs(flow) > 1e-6 * np.sqrt(surface * square)
        skewed = np.abs(cube) > 1e-6 * np.sqrt(square**3 / surface)
        sign[some] = np.where(flows, np.sign(flow), np.where(skewed, np.sign(cube), 1.0))
    return surface, parts, sign


def _phase(x: Array, power: Array) -> Array:
    """Unit phase (m,) of the sphere's far pressure for the part with the most power, from the instant the sound leaves the surface."""
    # p = ρ₀c i^... h_l(x)/h_l'(x): l = 0: ix/(1+ix); l = 1: -x²/(2-x²+2ix); l = 2: -ix³/(9-4x²+i(9x-x³))
    laws = np.stack([1j * x / (1 + 1j * x), -(x**2) / (2 - x**2 + 2j * x), -1j * x**3 / (9 - 4 * x**2 + 1j * (9 * x - x**3))])
    lead = np.argmax(power, axis=0)
    chosen = laws[lead, np.arange(len(x))]
    size = np.abs(chosen)
    return np.where(size > 0, chosen / np.where(size > 0, size, 1), 1j)


def jerk_coefficient(volume_m3: float, air: Air) -> float:
    """K = 3ρ₀V/(8πc) in Pa·m per m/s³: a rigid compact body's far pressure is K cosθ · jerk(t - r/c)/r [Chadwick, Zheng, James 2012, eq. 9].

    θ from the jerk to the listener. The sphere's own law at small ka: displaced air and half as much again as added mass [Pierce 1989, sec. 4-2].
    """
    return 3 * air.density_kg_m3 * volume_m3 / (8 * np.pi * air.sound_speed_m_s)
