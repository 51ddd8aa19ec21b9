"""Effects of material, object and fixture: they change modes or damping.

damping-law      d = ηω/2  |  d₁ (f/1 kHz)^p  |  ½Δω ωτ/(1+(ωτ)²) + d₀                           [Zener 1948, ch. 5]
support-damping  D += Φᵀ C Φ,  C = c n nᵀ (or c 1₃) at the fixture
    [Woodhouse 1998, eq. 12]
radiation        D += ρ₀ c_air σ ∮(φ·n)² dS,  σ = (ka)^p/(1+(ka)^p)
    [Cremer & Heckl, ch. 6]
orthotropy       K with E_x ≠ E_y ≠ E_z                                                           [Bodig & Jayne 1982]
added-mass       M += m at one point
mode-splitting   each pair of twins turned to the imperfection and pulled apart, or K softer on one side
    [Rayleigh 1894, §233]
"""

from __future__ import annotations

from dataclasses import replace
from pathlib import Path

import numpy as np

from benchmarks.suite.bricks import Modes, orthotropic
from benchmarks.suite.effects.base import Effect, Scene, jitter, pick
from benchmarks.suite.objects import Recipe, solved
from sonic_bullet.records import Array


def damping_law(strength: int, rng: np.random.Generator, scene: Scene) -> Effect:
    """Constant loss, power law or relaxation in Rayleigh's place; the stronger the lossier."""
    value = scene.body.modes.value
    middle = float(np.median(value) ** 0.5)
    plain = scene.material.alpha + scene.material.beta * middle**2
    eta = jitter(rng, pick(strength, 0.5, 1, 2.5) * plain / middle)
    law = ("constant-loss", "power", "relaxation")[int(rng.integers(3))]
    truth: dict[str, object] = {"law": law}
    if law == "constant-loss":
        truth["eta"] = eta

        def loss(omega: Array) -> Array:
            return eta * omega
    elif law == "power":
        p = float(rng.choice([0.5, 0.7, 1.4]))
        at_1k = eta * middle / 2 * (2 * np.pi * 1000 / middle) ** p
        truth |= {"d_1khz": at_1k, "exponent": p}

        def loss(omega: Array) -> Array:
            return np.asarray(2 * at_1k * (omega / (2 * np.pi * 1000)) ** p)
    else:
        peak = float(rng.uniform(0.6, 1.4)) * middle
        truth |= {"delta": 2 * eta, "tau": 1 / peak, "eta_floor": 0.1 * eta}

        def loss(omega: Array) -> Array:
            x = omega / peak
            return omega * (2 * eta * x / (1 + x**2) + 0.1 * eta)

    return Effect(
        "damping-law",
        "material",
        truth,
        damping=lambda modes, d: d - np.diag(np.diag(d)) + np.diag(loss(np.sqrt(modes.value))),
    )


def support_damping(strength: int, rng: np.random.Generator, scene: Scene) -> Effect:
    """Dashpots at one to three points of the surface, across it or in every direction."""
    body = scene.body
    moving = np.nan_to_num((np.einsum("vx,vxm->vm", body.normal, body.modes.shape) ** 2).mean(axis=1))
    points = rng.choice(np.flatnonzero(moving > np.median(moving)), int(rng.integers(1, 4)), replace=False)
    plain = np.median(scene.material.alpha + scene.material.beta * body.modes.value)
    ways = [body.normal[[v]] if rng.random() < 0.6 else np.eye(3) for v in points]
    phi = np.concatenate([way @ body.modes.shape[v] for v, way in zip(points, ways, strict=True)])  # (k, m)
    c = jitter(rng, pick(strength, 0.03, 0.4, 2) * plain / (phi**2).sum(axis=0).mean())
    truth = {"vertices": [int(v) for v in points], "c": c}

    def damping(modes: Modes, d: Array) -> Array:
        part = np.concatenate([way @ modes.shape[v] for v, way in zip(points, ways, strict=True)])
        return np.asarray(d + c * part.T @ part)

    return Effect("support-damping", "fixture", truth, damping=damping)


def radiation(strength: int, rng: np.random.Generator, scene: Scene) -> Effect:
    """Each mode loses 0.3, 3 or 10 times what it radiates into air; half the stronger cases also hear it: levels tilted
    by √σ.
    """
    order = float(rng.choice([2, 4]))
    size = np.sqrt(_area(scene.body.modes) / 8 / np.pi) * float(rng.uniform(0.5, 1))
    times = jitter(rng, pick(strength, 0.3, 3, 10))
    tilted = bool(rng.random() < 0.5) and strength > 0

    def sigma(modes: Modes) -> Array:
        ka = np.sqrt(modes.value) / 343 * size
        return np.asarray(ka**order / (1 + ka**order))

    def damping(modes: Modes, d: Array) -> Array:
        # the shapes come tilted as they are heard: the surface moves as before
        moved = _flow(modes) / (np.sqrt(sigma(modes)) if tilted else 1.0)
        return d + np.diag(times * 1.2 * 343 * sigma(modes) * moved)

    def pairs(modes: Modes) -> Modes:
        return replace(modes, shape=modes.shape * sigma(modes) ** 0.25) if tilted else modes

    truth = {"a_m": size, "order": order, "times": times, "levels": tilted}
    return Effect("radiation", "material", truth, damping=damping, pairs=pairs)


def _area(modes: Modes) -> float:
    corner = modes.vertex_m[modes.face]
    return float(np.linalg.norm(np.cross(corner[:, 1] - corner[:, 0], corner[:, 2] - corner[:, 0]), axis=1).sum() / 2)


def _flow(modes: Modes) -> Array:
    """∮(φ·n)² dS (m,), by the mean over each triangle's corners."""
    corner = modes.vertex_m[modes.face]
    area = np.cross(corner[:, 1] - corner[:, 0], corner[:, 2] - corner[:, 0]) / 2
    size = np.linalg.norm(area, axis=1)
    normal = area / np.maximum(size, 1e-30)[:, None]
    through = np.einsum("fx,fkxm->fkm", normal, modes.shape[modes.face])
    return np.asarray(np.einsum("f,fkm->m", size / 3, through**2))


def orthotropy(strength: int, rng: np.random.Generator, scene: Scene) -> Effect:
    """E along x over E along y: 1.25, 2 or 8; shear between."""
    ratio = jitter(rng, pick(strength, 1.25, 2, 8), 0.1)
    third = float(rng.choice([1.0, ratio**-0.5]))
    nu = scene.material.poisson
    e = np.array([1.0, 1 / ratio, third / ratio])
    g = np.sqrt(np.array([e[1] * e[2], e[0] * e[2], e[0] * e[1]])) / (2 * (1 + nu)) * float(rng.uniform(0.7, 1))
    tensor = orthotropic((e[0], e[1], e[2]), (g[0], g[1], g[2]), (nu * 0.8, nu, nu))
    tag = f"orthotropy {np.round(tensor, 6).tolist()}"
    truth = {"youngs_ratio": [1.0, 1 / ratio, third / ratio], "shear_ratio": g.tolist(), "poisson": [nu * 0.8, nu, nu]}
    return Effect(
        "orthotropy",
        "material",
        truth,
        modes=lambda recipe, poisson, folder: solved(recipe, poisson, folder, tensor=tensor, tag=tag),
    )


def added_mass(strength: int, rng: np.random.Generator, scene: Scene) -> Effect:
    """A blob of 2, 5 or 12 % of the body's mass, at a place that the low modes move."""
    body = scene.body
    low = (body.modes.shape[:, :, :8] ** 2).sum(axis=(1, 2))
    vertex = int(rng.choice(np.flatnonzero(low > np.quantile(low, 0.6))))
    part = jitter(rng, pick(strength, 0.02, 0.05, 0.12))
    truth = {"vertices": [vertex], "mass": part * body.modes.mass_kg}

    def modes(recipe: Recipe, poisson: float, folder: Path) -> Modes:
        return solved(recipe, poisson, folder, load={vertex: part}, tag=f"load {vertex} {part:.6f}")

    return Effect("added-mass", "object", truth, modes=modes)


def mode_splitting(strength: int, rng: np.random.Generator, scene: Scene) -> Effect:
    """Twins pulled apart by 0.15, 0.5 or 1.2 %: by a wall softer on one side (every pair differently), or all pairs
    alike.
    """
    split = jitter(rng, pick(strength, 0.0015, 0.005, 0.012), 0.15)
    azimuth = float(rng.uniform(0, np.pi))
    if rng.random() < 0.5:
        wave = rng.standard_normal(12)

        def softer(centre: Array) -> Array:
            angle = 2 * np.pi * centre[:, 0] - azimuth
            bumps = sum(w * np.cos((k + 1) * angle + 3 * w) for k, w in enumerate(wave))
            return np.asarray(1 + 2.5 * split * bumps)

        tag = f"softer {split:.6f} {azimuth:.4f}"
        truth = {"split": split, "azimuth": azimuth, "form": "stiffness"}
        return Effect(
            "mode-splitting",
            "object",
            truth,
            modes=lambda recipe, poisson, folder: solved(recipe, poisson, folder, softer=softer, tag=tag),
        )
    spread = np.exp(rng.uniform(-0.5, 0.5, 200)) if rng.random() < 0.5 else np.ones(200)

    def pairs(modes: Modes) -> Modes:
        value, shape = modes.value.copy(), modes.shape.copy()
        angle = np.arctan2(modes.vertex_m[:, 1], modes.vertex_m[:, 0])
        k = 0
        while k < len(value) - 1:
            if value[k + 1] / value[k] - 1 > 2e-4:
                k += 1
                continue
            # turn the pair until its second twin does not move at the imperfection
            here = np.argmin(
                np.abs(np.angle(np.exp(1j * (angle - azimuth))))
                + np.abs(modes.vertex_m[:, 2] - np.median(modes.vertex_m[:, 2]))
            )
            across = scene.body.normal[here] @ modes.shape[here][:, k : k + 2]
            c, s = across / max(np.linalg.norm(across), 1e-30)
            shape[:, :, k] = c * modes.shape[:, :, k] + s * modes.shape[:, :, k + 1]
            shape[:, :, k + 1] = -s * modes.shape[:, :, k] + c * modes.shape[:, :, k + 1]
            mean = (value[k] + value[k + 1]) / 2
            value[k], value[k + 1] = mean * (1 - split * spread[k]), mean * (1 + split * spread[k])
            k += 2
        return replace(modes, value=value, shape=shape)

    return Effect("mode-splitting", "object", {"split": split, "azimuth": azimuth, "form": "pairs"}, pairs=pairs)
