"""Are levels right, in pascals? The chain from impact to pressure beside figures that others published.

    python benchmarks/levels.py [--only stopped tapping spoon mug]

    stopped   a steel ball that stops at once, by the bank's own translation: energy that leaves over its kinetic energy
    tapping   the tapping machine (500 g, 40 mm, 10 a second) on floors: pulse, plate, loss in place, one side radiates
    spoon     a spoon dropped on a plate, as a scene; spread over heights, distances and places
    mug       the peak of scenes/drop.py, with its parts: both bodies, the board alone, the mug alone

docs/explanation/levels.md says where the published figures come from and what the differences mean.
"""

from __future__ import annotations

import argparse
import sys
from collections.abc import Iterator
from pathlib import Path

import numpy as np

sys.path.insert(0, str(Path(__file__).resolve().parents[1]))

import sonic_bullet as sb
from sonic_bullet.bank import ModeSet, Translation, append, empty_bank
from sonic_bullet.contact.pulse_shape import pulse_length, pulse_spectrum
from sonic_bullet.listener import direct_client, disconnect
from sonic_bullet.presets import load_material
from sonic_bullet.radiation.far_field import jerk_coefficient
from sonic_bullet.records import Air, Array, Material
from sonic_bullet.scene import render_scene
from tests.made.banks import Strike, advance

IN_PLACE = 0.03

AIR = Air()
RHO_C = AIR.density_kg_m3 * AIR.sound_speed_m_s
BANDS_HZ = 100 * 10 ** (np.arange(16) / 10)
"""Third octaves, 100 … 3150 Hz."""
HEAVY_DB = [67, 67.5, 68, 68.5, 69, 69.5, 70, 70.5, 71, 71.5, 72, 72, 72, 72, 72, 72]
"""Ln,r,0 of the reference floor [ISO 717-2, table 4]: a bare slab of 120 mm, A0 = 10 m²."""
TIMBER_DB = [78, 78, 78, 78, 78, 78, 76, 74, 72, 69, 66, 63, 60, 57, 54, 51]
"""Lt,r,0 of the light reference floors C1 and C2 [ISO 717-2, annex on lightweight floors]: boards on joists, under
which hangs the ceiling that radiates.
"""
HAMMER_KG, DROP_M, RATE_HZ, HEAD_M = 0.5, 0.04, 10.0, 0.5
ASSETS = Path(__file__).resolve().parents[1] / "assets"


def db(ratio: float) -> float:
    return float(10 * np.log10(ratio))


def stopped(sr: int = 1_536_000) -> Iterator[str]:
    """Kirchhoff 1876: ρ₀/2ρ_s of the energy of a sphere that stops at once."""
    density, radius, speed = 7850.0, 0.02, 1.0
    volume = 4 / 3 * np.pi * radius**3
    rate = AIR.sound_speed_m_s / radius
    weight = 2 * jerk_coefficient(volume, AIR) * rate**2 / (density * volume)
    silent = np.zeros(0)
    one = ModeSet(silent, silent, np.zeros((1, 0), complex), translation=Translation(rate, rate, weight))
    bank, state = append(*empty_bank(sr), [one])
    dipole = np.zeros((1, 3, 4096))
    rigid_impulse = np.array([density * volume * speed, 0.0, 0.0])
    advance(bank, state, 4096, [Strike(0, 0.0, 1e-7, silent, True, rigid_impulse)], dipole=dipole)
    energy = np.sum(dipole[0, 0] ** 2) / sr / RHO_C * 4 * np.pi / 3  # cos²θ over the sphere at 1 m
    share, law = energy / (0.5 * density * volume * speed**2), AIR.density_kg_m3 / (2 * density)
    yield f"stopped at once: {share:.3g} of its energy, closed form {law:.3g}: {db(share / law):+.2f} dB"


def floor_power_w(material: Material, thickness_m: float, loss: float) -> Array:
    """(16,) sound power in W of one side, of the tapping machine on a plate that is large.

    Hammers do not bounce: p = m v falls as the pulse of m against the plate's mass at the contact; lines 2 p f_s |F̂|,
    of which half their square is power in the plate through Re Y = 1/(8√(Dρh)), and η_r/(η + 2η_r) of it leaves, η_r =
    ρ₀cσ/(ωρh), since both sides radiate [Cremer, Heckl & Petersson 2005, sec. 4.3.2, 6.9]; σ = 1/√(1 − f_c/f) above
    f_c, at most 1 below [σ of long plates].
    """
    v = np.sqrt(2 * 9.81 * DROP_M)
    stiff, surface = material.plane_strain_pa * thickness_m**3 / 12, material.density_kg_m3 * thickness_m
    modulus = 1 / (1 / material.plane_strain_pa + 1 / load_material("steel").plane_strain_pa)
    tau, flat = pulse_length.py_func(HAMMER_KG, modulus, 1 / HEAD_M, np.pi * 0.015**2, v)
    mobility = 1 / (8 * np.sqrt(stiff * surface))
    critical = AIR.sound_speed_m_s**2 / (2 * np.pi) * np.sqrt(surface / stiff)
    power = []
    for centre in BANDS_HZ:
        f = centre * 10 ** np.linspace(-0.05, 0.05, 21)
        lines = centre * (10**0.05 - 10**-0.05) / RATE_HZ
        force = 2 * HAMMER_KG * v * RATE_HZ * pulse_spectrum(f * tau, flat=bool(flat))
        # a mass that the plate takes along: F/(1 + iωmY) [ibid., sec. 4.3.2]
        force = force / np.abs(1 + 2j * np.pi * f * HAMMER_KG * mobility)
        sigma = np.where(
            f > 1.2 * critical, 1 / np.sqrt(np.maximum(1 - critical / f, 0.1)), np.minimum(f / critical, 1)
        )
        taken = 0.5 * force**2 * mobility * lines
        radiated = RHO_C * sigma / (2 * np.pi * f * surface)
        power.append(np.mean(taken * radiated / (loss + 2 * radiated)))
    return np.array(power)


def tapping() -> Iterator[str]:
    """ISO's reference floors. Power in: 10 · m g h = 1.96 W."""
    total_w = RATE_HZ * HAMMER_KG * 9.81 * DROP_M
    for name, material, thickness, reference in (
        ("concrete, 120 mm", load_material("concrete"), 0.12, HEAVY_DB),
        ("boards, 22 mm spruce", load_material("spruce"), 0.022, TIMBER_DB),
    ):
        measured = np.sum(1e-12 * 10 ** ((np.array(reference) + db(10 / 4)) / 10))
        for loss in (IN_PLACE / 3, IN_PLACE, 3 * IN_PLACE):
            made = floor_power_w(material, thickness, loss)
            bands = 10 * np.log10(made / (1e-12 * 10 ** ((np.array(reference) + db(10 / 4)) / 10)))
            yield (
                f"tapping machine on {name}, η {loss:.2f}: {made.sum() / total_w:.2g} of {total_w:.2f} W, reference "
                f"{measured / total_w:.2g}: {db(made.sum() / measured):+.1f} dB "
                f"(bands {bands.min():+.0f} … {bands.max():+.0f})"
            )


def spoon_peak_db(height_m: float, place_m: float, seed: int) -> tuple[float, float]:
    """Peak in dB SPL at 0.5 and 1 m of a spoon of 39 g, as a rod, dropped on a plate that stands on a wooden table."""
    client = direct_client()
    client.setGravity(0, 0, -9.81)
    half = [0.4, 0.3, 0.012]
    table = client.createMultiBody(
        0, client.createCollisionShape(client.GEOM_BOX, halfExtents=half), basePosition=[0, 0, -0.012]
    )
    shape = client.createCollisionShape(client.GEOM_MESH, fileName=str(ASSETS / "plate.obj"))
    plate = client.createMultiBody(2400 * 206.8e-6, shape, basePosition=[0, 0, 0.012])
    rod = client.createCollisionShape(client.GEOM_CYLINDER, radius=0.004, height=0.1)
    turn = client.getQuaternionFromEuler([1.2 + 0.1 * seed, 0.2, 0.4])
    spoon = client.createMultiBody(0.039, rod, basePosition=[place_m, 0, height_m + 0.06], baseOrientation=turn)
    for body in (table, plate, spoon):
        client.changeDynamics(body, -1, restitution=0.7)
    sb.keep_restitution(client)
    listener = sb.attach(client, microphone=[(0, -0.35, 0.35), (0, -0.7, 0.7)])
    listener.add_all({table: {"material": "wood", "count": 60}, plate: "porcelain", spoon: "steel"})
    for _ in range(120):
        client.stepSimulation()
    peak = np.abs(listener.sound()).max(axis=1)
    disconnect(client)
    near, far = (20 * np.log10(peak / 2e-5)).tolist()
    return near, far


def spoon() -> Iterator[str]:
    for height in (0.05, 0.15):
        found = np.array([spoon_peak_db(height, place, seed) for seed, place in enumerate((0.0, 0.05, 0.08))])
        (near, far), spread = found.mean(axis=0), np.ptp(found, axis=0).max()
        yield (
            f"spoon from {height * 100:.0f} cm: {near:.1f} dB at 0.5 m, {far:.1f} dB at 1 m, spread {spread:.1f}; "
            "Killion 110 … 115"
        )


def mug() -> Iterator[str]:
    result = render_scene(Path(__file__).resolve().parents[1] / "scenes" / "drop.py", seconds=0.6)
    yield f"mug from 22 cm: {20 * np.log10(np.abs(result.samples).max() / 2e-5):.1f} dB at 0.7 m; claim 105 … 122"


PARTS = {"stopped": stopped, "tapping": tapping, "spoon": spoon, "mug": mug}


def main() -> None:
    parser = argparse.ArgumentParser(description=(__doc__ or "").split("\n")[0])
    parser.add_argument("--only", nargs="*", choices=PARTS, default=list(PARTS))
    for name in parser.parse_args().only:
        for line in PARTS[name]():
            print(line, flush=True)


if __name__ == "__main__":
    main()
