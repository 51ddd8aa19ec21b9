"""Are levels right, in pascals? The chain from impact to pressure beside figures that others published.

    python benchmarks/levels.py [--only stopped tapping spoon mug]

    stopped   a steel ball that stops at once, by the bank's own translation: energy that leaves over its kinetic energy
    tapping   the tapping machine (500 g, 40 mm, 10 a second) on floors of 4 × 2.5 m, as scenes: power of one side
    spoon     a spoon dropped on a plate, as a scene; spread over heights, distances and places
    mug       the peak of scenes/drop.py: by the mean over all sides, on the microphone's side, and over 64 directions

docs/explanation/levels.md says where the published figures come from and what the differences mean.
"""

from __future__ import annotations

import argparse
import sys
from collections.abc import Iterator
from dataclasses import replace
from pathlib import Path

import numpy as np

sys.path.insert(0, str(Path(__file__).resolve().parents[1]))

import sonic_bullet as sb
from sonic_bullet.engine.bank import ModeSet, Translation, append, empty_bank
from sonic_bullet.files.contact_log import ContactLog
from sonic_bullet.files.presets import load_material
from sonic_bullet.radiation.far_field import jerk_coefficient, spread_directions
from sonic_bullet.records import Air, Array, Microphone
from sonic_bullet.scene import render_scene
from sonic_bullet.simulators import direct_client, disconnect
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
HAMMER_KG, DROP_M, RATE_HZ = 0.5, 0.04, 10.0
FLOOR_M = 4.0, 2.5
TAPS = 10
FAR_M = 50.0
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


def tapped(material: str, thickness_m: float) -> ContactLog:
    """The log of a floor that lies in a building, and of steel hammers of 30 mm that fall on ten places of it.

    Each hammer is its own body, for 0.15 s: the machine's lie on the floor after their stroke, and are lifted.
    """
    client = direct_client()
    client.setGravity(0, 0, -9.81)
    half = [FLOOR_M[0] / 2, FLOOR_M[1] / 2, thickness_m / 2]
    floor = client.createMultiBody(
        0, client.createCollisionShape(client.GEOM_BOX, halfExtents=half), basePosition=[0, 0, -half[2]]
    )
    long_m = HAMMER_KG / (load_material("steel").density_kg_m3 * np.pi * 0.015**2)
    head = client.createCollisionShape(client.GEOM_CYLINDER, radius=0.015, height=long_m)
    sb.keep_restitution(client)
    listener = sb.attach(client, microphone=(0, 0, FAR_M))
    listener.add(floor, material=material, to_hz=4000.0, tail=True, name="floor")
    place = np.random.default_rng(0).uniform(-0.4, 0.4, (TAPS, 2)) * FLOOR_M
    standing: list[tuple[int, int]] = []
    for step in range(round((TAPS / RATE_HZ + 1.0) * 240)):
        tap, due = divmod(step, round(240 / RATE_HZ))
        if due == 0 and tap < TAPS:
            base = [*place[tap].tolist(), DROP_M + long_m / 2]
            hammer = client.createMultiBody(HAMMER_KG, head, basePosition=base)
            client.changeDynamics(hammer, -1, linearDamping=0, angularDamping=0)
            listener.add(hammer, material="steel", name=f"hammer {tap}")
            standing.append((hammer, step + 36))
        if standing and standing[0][1] == step:
            client.removeBody(standing.pop(0)[0])
        client.stepSimulation()
    listener.sound()
    log: ContactLog = listener.contacts
    disconnect(client)
    return log


def floor_power_w(log: ContactLog, loss: float) -> Array:
    """(16,) sound power in W of one side in third octaves.

    The floor alone is heard, far away and as the mean over all sides, with a loss factor beside its material's own. One
    side is half of the power.
    """
    own = [replace(one, mounting=loss) if one.name == "floor" else replace(one, silent=True) for one in log.bodies]
    sound = sb.render_log(replace(log, bodies=tuple(own)))[0]
    power = np.abs(np.fft.rfft(sound)) ** 2 * 2 / len(sound) / log.sr / RHO_C * 4 * np.pi * FAR_M**2
    f = np.fft.rfftfreq(len(sound), 1 / log.sr)
    edge = BANDS_HZ[:, None] * 10 ** (np.array([-0.05, 0.05]))
    bands = np.array([power[(f >= low) & (f < high)].sum() for low, high in edge])
    return bands / 2 * RATE_HZ / TAPS


def tapping() -> Iterator[str]:
    """ISO's reference floors. Power in: 10 · m g h = 1.96 W."""
    total_w = RATE_HZ * HAMMER_KG * 9.81 * DROP_M
    for name, material, thickness, reference in (
        ("concrete, 120 mm", "concrete", 0.12, HEAVY_DB),
        ("boards, 22 mm spruce", "spruce", 0.022, TIMBER_DB),
    ):
        log = tapped(material, thickness)
        model = next(one.model for one in log.bodies if one.name == "floor")
        assert model is not None
        yield f"{name}: {model.mode_count} modes, {model.note}"
        measured = 1e-12 * 10 ** ((np.array(reference) + db(10 / 4)) / 10)
        for loss in (IN_PLACE / 3, IN_PLACE, 3 * IN_PLACE):
            made = floor_power_w(log, loss)
            bands = 10 * np.log10(made / measured)
            yield (
                f"tapping machine on {name}, η {loss:.2f}: {made.sum() / total_w:.2g} of {total_w:.2f} W, reference "
                f"{measured.sum() / total_w:.2g}: {db(made.sum() / measured.sum()):+.1f} dB (bands "
                f"{', '.join(f'{one:+.0f}' for one in bands)})"
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
    place = np.array([one.position_m for one in result.log.sensors if isinstance(one, Microphone)])[0]
    distance = float(np.linalg.norm(place))
    around = distance * spread_directions(32)[0]
    sensors = [Microphone(one, directivity=True) for one in (place, *around, *-around)]
    peak = np.abs(sb.render_log(replace(result.log, sensors=tuple(sensors)))).max(axis=1)
    mean, side, *every = (20 * np.log10(np.array([np.abs(result.samples).max(), *peak]) / 2e-5)).tolist()
    power = 10 * np.log10(np.mean(10 ** (np.array(every) / 10)))
    yield (
        f"mug from 22 cm at {distance:.1f} m: {mean:.1f} dB by the mean over all sides, {side:.1f} dB on the "
        f"microphone's; 64 directions {min(every):.0f} … {max(every):.0f}, median {np.median(every):.1f}, "
        f"mean power {power:.1f}; claim 105 … 122"
    )


PARTS = {"stopped": stopped, "tapping": tapping, "spoon": spoon, "mug": mug}


def main() -> None:
    parser = argparse.ArgumentParser(description=(__doc__ or "").split("\n")[0])
    parser.add_argument("--only", nargs="*", choices=PARTS, default=list(PARTS))
    for name in parser.parse_args().only:
        for line in PARTS[name]():
            print(line, flush=True)


if __name__ == "__main__":
    main()
