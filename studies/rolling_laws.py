"""Do rolling and sliding keep the measured laws through the whole chain: PyBullet, listener, contact, modes,
microphone?

    python studies/rolling_laws.py        some minutes

    level ∝ roughness^m · speed^n, m 0.63 … 1.16, n 0.5 … 0.96, either exponent the same whatever the other quantity is
    no line at the step rate: within 5 Hz of 240 Hz and its multiples the spectrum stays within 3 dB of its
        neighbourhood

One simulation a speed; roughness changes nothing that PyBullet sees, so the log is rendered again with another.
"""

from __future__ import annotations

from dataclasses import dataclass, replace

import numpy as np
import pybullet
import pybullet_utils.bullet_client as bc
from scipy.signal import welch

import sonic_bullet as sb
from sonic_bullet.engine.runtime.replay import render_log
from sonic_bullet.files.contact_log import ContactLog
from sonic_bullet.records import Array

STEP_HZ = 240
MICROPHONE = (0.0, -0.5, 0.3)
SETTLED_S = 0.3
BALL_M = 0.015
BOX_M = (0.04, 0.03, 0.02)


def run(
    kind: str,
    speed_m_s: float,
    seconds: float,
    *,
    floor: str | None = "wood",
    count: int | None = None,
    slope: float = 0.0,
) -> ContactLog:
    """A steel ball rolls, or a wooden box slides without friction, through the middle of a board.

    floor: the board's material, None: it is silent. slope: the push, as a share of the weight, that friction of that
    coefficient balances.
    """
    client = bc.BulletClient(pybullet.DIRECT)
    client.setGravity(0, 0, -9.81)
    listener = sb.attach(client, microphone=MICROPHONE)
    board = client.createMultiBody(
        0, client.createCollisionShape(pybullet.GEOM_BOX, halfExtents=[0.5, 0.12, 0.01]), basePosition=[0, 0, -0.01]
    )
    start = -0.5 * speed_m_s * seconds
    if kind == "ball":
        shape = client.createCollisionShape(pybullet.GEOM_SPHERE, radius=BALL_M)
        mass, height, spin, friction = 7850 * 4 / 3 * np.pi * BALL_M**3, BALL_M, speed_m_s / BALL_M, 0.6
    else:
        shape = client.createCollisionShape(pybullet.GEOM_BOX, halfExtents=BOX_M)
        mass, height, spin, friction = float(700 * 8 * np.prod(BOX_M)), BOX_M[2], 0.0, slope**0.5
    body = client.createMultiBody(mass, shape, basePosition=[start, 0, height])
    for one in (board, body):
        client.changeDynamics(one, -1, lateralFriction=friction, linearDamping=0, angularDamping=0)
    client.resetBaseVelocity(body, [speed_m_s, 0, 0], [0, spin, 0])
    if floor is not None:
        listener.add(board, material=floor, roughness_m=1e-6, count=count)
    listener.add(body, material="steel" if kind == "ball" else "wood", roughness_m=1e-6, count=count)
    for _ in range(round(seconds * STEP_HZ)):
        if slope:
            client.applyExternalForce(
                body,
                -1,
                [slope * mass * 9.81, 0, 0],
                client.getBasePositionAndOrientation(body)[0],
                pybullet.WORLD_FRAME,
            )
        client.stepSimulation()
    listener.detach()
    client.disconnect()
    return listener.contacts


def observed(log: ContactLog, roughness_m: float, seed: int = 0) -> Array:
    """(n,) pressure in Pa after the start has died away; every surface is that rough, that of a silent floor, too."""
    ball = next(b.material for b in log.bodies if b.material is not None)
    bodies = tuple(replace(b, material=replace(b.material or ball, roughness_m=roughness_m)) for b in log.bodies)
    return np.asarray(render_log(replace(log, bodies=bodies, seed=seed))[0, round(SETTLED_S * log.sr) :])


@dataclass(frozen=True)
class Law:
    """Exponent of level against a quantity at each value of the other, and the worst R² of these lines."""

    exponent: Array
    least_r2: float


def law(quantity: Array, level: Array) -> Law:
    """Level (others, values) against quantity (values,)."""
    x = np.log(quantity)
    fits = [(np.polyfit(x, np.log(row), 1)[0], np.corrcoef(x, np.log(row))[0, 1] ** 2) for row in level]
    return Law(np.array([slope for slope, _ in fits]), min(r2 for _, r2 in fits))


def excess_db(pressure: Array, sr: int, upto_hz: float = 6000.0) -> Array:
    """By how many dB the power within 5 Hz of each multiple of the step rate passes that of its neighbourhood, 5 … 40
    Hz away on either side.
    """
    freq, power = welch(pressure, sr, nperseg=sr, noverlap=sr // 2, window="blackmanharris")
    out = []
    for line in np.arange(STEP_HZ, upto_hz, STEP_HZ):
        off = np.abs(freq - line)
        out.append(10 * np.log10(power[off <= 5].mean() / power[(off > 5) & (off <= 40)].mean()))
    return np.array(out)


def table(kind: str, speeds: Array, roughness: Array, seconds: float, **options: float) -> Array:
    """(speeds, roughness) rms pressure in Pa."""
    return np.array(
        [
            [observed(log, h).std() for h in roughness]
            for log in (run(kind, v, seconds, count=60, **options) for v in speeds)  # type: ignore[arg-type]
        ]
    )


if __name__ == "__main__":
    for name, kind, options in (
        ("ball", "ball", {}),
        ("box", "box", {}),
        ("box with friction 0.3", "box", {"slope": 0.3}),
    ):
        speeds, roughness = np.geomspace(0.08, 0.4, 6), np.geomspace(0.2e-6, 5e-6, 6)
        rms = table(kind, speeds, roughness, 2.0, **options)
        n, m = law(speeds, rms.T), law(roughness, rms)
        print(
            f"{name}: dB SPL, a row a speed {np.round(speeds, 3)} m/s, a column a roughness "
            f"{np.round(roughness * 1e6, 2)} µm"
        )
        print(np.round(20 * np.log10(rms / 2e-5), 1))
        print(
            f"  m {np.round(m.exponent, 3)}, R² ≥ {m.least_r2:.4f};  n {np.round(n.exponent, 3)}, R² ≥ {n.least_r2:.4f}"
        )
    for floor in (None, "wood"):
        log = run("ball", 0.15, 6.0, floor=floor, count=60)
        loud = observed(log, 2e-6)
        smooth = observed(log, 0.0)
        line = excess_db(loud, log.sr)
        above = 20 * np.log10(loud.std() / max(smooth.std(), 1e-300))
        print(
            f"step rate, floor {floor}: worst excess {line.max():+.2f} dB of {len(line)} multiples; "
            f"{above:.0f} dB above the same scene with smooth surfaces"
        )
