"""How far are the pressure weights of `radiation.far_field` from a boundary element solution of the same modes?

    python studies/radiation_bem.py [--only plate] [--modes 24] [--coarse]

Helmholtz boundary elements after Burton & Miller 1971, eq. 3.5 (no irregular frequencies), constant on triangles,
collocated at centroids:
    (½ - K) φ - βDφ = S v + β(½ + K') v,   β = -i/max(k, 1/a),   p = iωρφ,   G = e^{-ikr}/4πr
A body's symmetries are used, so that a piece of the surface and a small matrix do for a fine mesh: with operations g
and a mode's characters χ(g), the matrix is Σ χ(g) A(x, g y). Meshes are graded to the edges, and not the run time's.
Kernels at k = 0, and what k adds to D in ½k² n·n'/r, are in closed form, the rest by 7 points a triangle.

Spheres first, against closed forms: within 1 %. Then a line a mode: frequency, σ, the law's level error in dB, the
solution's own two powers against each other (surface over far field; it says little of shapes that hardly radiate), and
the mode's largest part of a strike's energy: half-sine pulses of 0.3 ms along the normals of 300 places.
"""

from __future__ import annotations

import argparse
from collections.abc import Sequence
from dataclasses import dataclass
from pathlib import Path

import numpy as np
import trimesh
from scipy.special import spherical_jn, spherical_yn

from sonic_bullet.files.presets import load_material
from sonic_bullet.geometry import nearest, surface_index
from sonic_bullet.modal import analyse
from sonic_bullet.radiation.far_field import radiation
from sonic_bullet.records import Air, Array, ModalModel, Shape

AIR = Air()
RHO_C = AIR.density_kg_m3 * AIR.sound_speed_m_s
REFLECTIONS = tuple(np.diag([x, y, z]).astype(float) for x in (1, -1) for y in (1, -1) for z in (1, -1))
PULSE_S = 0.3e-3
# Seven points of degree 5 [Strang & Fix 1973, tab. 4.1].
_A, _B = (6 - 15**0.5) / 21, (6 + 15**0.5) / 21
POINTS = np.array([[1 / 3] * 3, *(np.roll([1 - 2 * x, x, x], i) for x in (_A, _B) for i in range(3))])
SHARES = np.array([9 / 40] + [(155 - 15**0.5) / 1200] * 3 + [(155 + 15**0.5) / 1200] * 3)


@dataclass(frozen=True)
class Yardstick:
    """A surface as a piece and the operations that make the whole of it.

    Attributes
    ----------
    corner_m : (f, 3, 3)
        Triangles of the piece, outward.
    operation : tuple of (3, 3)
        The identity first.
    """

    corner_m: Array
    operation: tuple[Array, ...]

    def copies(self) -> list[Array]:
        """Return the triangles (f, 3, 3) of each copy, outward."""
        return [self.corner_m @ g.T if np.linalg.det(g) > 0 else (self.corner_m @ g.T)[:, ::-1] for g in self.operation]

    @property
    def count(self) -> int:
        """Return the triangles of the whole."""
        return len(self.corner_m) * len(self.operation)


def measures(corner: Array) -> tuple[Array, Array]:
    """Areas (f,) and normals (f, 3)."""
    twice = np.cross(corner[:, 1] - corner[:, 0], corner[:, 2] - corner[:, 0])
    length = np.linalg.norm(twice, axis=1)
    return length / 2, twice / length[:, None]


def dot(p: Array, q: Array) -> Array:
    """Scalar products along the last axis."""
    return np.asarray((p * q).sum(axis=-1))


def static_kernels(x: Array, facing: Array, corner: Array, own: bool) -> list[Array]:
    """S, K, K', D (f, f) of triangles at places x (f, 3) with normals, at k = 0; own: x are their centroids."""
    normal = measures(corner)[1]
    arm = corner[None] - x[:, None, None]
    r = np.linalg.norm(arm, axis=-1)
    a, b, c = arm[:, :, 0], arm[:, :, 1], arm[:, :, 2]
    ra, rb, rc = r[..., 0], r[..., 1], r[..., 2]
    solid = -2 * np.arctan2(dot(a, np.cross(b, c)), ra * rb * rc + dot(a, b) * rc + dot(b, c) * ra + dot(c, a) * rb)
    if own:
        np.fill_diagonal(solid, 0)
    potential = dot(a, normal[None]) * solid
    gradient = -normal[None] * solid[..., None]
    loop = np.zeros_like(gradient)
    for e in range(3):
        p, q, rp, rq = arm[:, :, e], arm[:, :, (e + 1) % 3], r[..., e], r[..., (e + 1) % 3]
        edge = q[0] - p[0]
        length = np.linalg.norm(edge, axis=-1)
        out = np.cross(edge, normal) / length[:, None]
        near = np.log((rp + rq + length) / (rp + rq - length))
        potential += dot(out, p) * near
        gradient -= out * near[..., None]
        loop += np.cross(p, q) * ((rp + rq) / (rp * rq * (rp * rq + dot(p, q))))[..., None]
    return [m / (4 * np.pi) for m in (potential, solid, dot(facing[:, None], gradient), -dot(facing[:, None], loop))]


def kernels(k: float, x: Array, facing: Array, corner: Array, static: list[Array]) -> list[Array]:
    """The same at k."""
    area, normal = measures(corner)
    both = facing @ normal.T
    s, kk, ks, d = (one.astype(complex) for one in static)
    d += 0.5 * k * k * static[0] * both
    for point, share in zip(POINTS, SHARES, strict=True):
        arm = x[:, None] - np.einsum("c,fci->fi", point, corner)[None]
        r = np.maximum(np.linalg.norm(arm, axis=-1), 1e-4 / k)  # nearer, what k changes is its limit
        rx, ry = dot(arm, facing[:, None]) / r, -dot(arm, normal[None]) / r
        wave, kr, w = np.exp(-1j * k * r), k * r, share * area / (4 * np.pi)
        first = (1 - wave * (1 + 1j * kr)) / r**2
        second = (wave * (2 + 2j * kr - kr**2) - 2) / r**3
        s += w * (wave - 1) / r
        kk += w * first * ry
        ks += w * first * rx
        d += w * ((second - first / r) * rx * ry - (first + 0.5 * k * k) / r * both)
    return [s, kk, ks, d]


def directions(rings: int = 20) -> tuple[Array, Array]:
    """Unit vectors (n, 3) and weights (n,), 1 in all: Gauss in height, even in angle."""
    height, share = np.polynomial.legendre.leggauss(rings)
    angle = np.pi * (np.arange(2 * rings) + 0.5) / rings
    radius = np.sqrt(1 - height**2)[:, None]
    vector = np.stack(
        np.broadcast_arrays(radius * np.cos(angle), radius * np.sin(angle), height[:, None]), axis=-1
    ).reshape(-1, 3)
    return vector, np.repeat(share / (4 * rings), 2 * rings)


def solve(body: Yardstick, speed: Array, character: Array, freq_hz: Array) -> tuple[Array, Array]:
    """√<|p|²> at 1 m (m,) and surface over far-field power in dB, of unit modal velocities.

    speed (f, 3, m): normal speeds at the piece's corners; character (m, g).
    """
    area, normal = measures(body.corner_m)
    x, copies = body.corner_m.mean(axis=1), body.copies()
    static = [static_kernels(x, normal, one, at == 0) for at, one in enumerate(copies)]
    direction, share = directions()
    level, check = np.zeros(len(freq_hz)), np.zeros(len(freq_hz))
    for m, freq in enumerate(freq_hz):
        k, omega = 2 * np.pi * freq / AIR.sound_speed_m_s, 2 * np.pi * freq
        made = [kernels(k, x, normal, one, known) for one, known in zip(copies, static, strict=True)]
        s, kk, ks, d = (sum(c * one[at] for c, one in zip(character[m], made, strict=True)) for at in range(4))
        beta = -1j / max(k, np.sqrt(4 * np.pi / (area.sum() * len(copies))))
        mean = speed[:, :, m].mean(axis=1)
        left = 0.5 * np.eye(len(area)) - kk - beta * d
        phi = np.linalg.solve(left, s @ mean + beta * (0.5 * mean + ks @ mean))
        total = np.zeros(len(direction), complex)
        for c, one, g in zip(character[m], copies, body.operation, strict=True):
            v = speed[:, :, m] if np.linalg.det(g) > 0 else speed[:, ::-1, m]
            facing = measures(one)[1] @ direction.T
            for point, weight in zip(POINTS, SHARES, strict=True):
                wave = np.exp(1j * k * np.einsum("c,fci->fi", point, one) @ direction.T)
                total += c * weight * ((area * (v @ point)) @ wave + 1j * k * ((area * phi) @ (wave * facing)))
        square = share @ np.abs(omega * AIR.density_kg_m3 / (4 * np.pi) * total) ** 2
        level[m] = np.sqrt(square)
        surface = 0.5 * len(copies) * np.real(np.sum(area * mean * 1j * omega * AIR.density_kg_m3 * phi))
        check[m] = 10 * np.log10(max(surface, 1e-300) / (2 * np.pi * square / RHO_C))
    return level, check


def octant_sphere(divisions: int) -> Yardstick:
    """Sphere of a unit ball's volume: an eighth of an octahedron, divided and blown up."""
    eye, found = np.eye(3), []
    for i in range(divisions):
        for j in range(divisions - i):
            a, b, c = ((i, j), (i + 1, j), (i, j + 1))
            found.append([a, b, c])
            if i + j < divisions - 1:
                found.append([b, (i + 1, j + 1), c])
    corner = np.array([[eye[0] * (divisions - i - j) + eye[1] * i + eye[2] * j for i, j in one] for one in found])
    corner /= np.linalg.norm(corner, axis=-1, keepdims=True)
    volume = 8 / 6 * dot(np.cross(corner[:, 0], corner[:, 1]), corner[:, 2]).sum()
    return Yardstick(corner * (4 * np.pi / 3 / volume) ** (1 / 3), REFLECTIONS)


def octant_box(size: tuple[float, ...], cells: tuple[int, ...]) -> Yardstick:
    """Box of edges in m, an eighth of it with cells of a half-edge, narrower towards the edges."""
    part = [np.arange(n + 1) / n for n in cells]
    axis = [
        s / 2 * (0.4 * t + 0.6 * np.sin(np.pi / 2 * t) if len(t) > 3 else t) for s, t in zip(size, part, strict=True)
    ]
    found = []
    for out in range(3):
        i, j = (out + 1) % 3, (out + 2) % 3
        for p in range(cells[i]):
            for q in range(cells[j]):
                four = np.zeros((4, 3))
                four[:, out] = size[out] / 2
                four[:, i] = axis[i][[p, p + 1, p + 1, p]]
                four[:, j] = axis[j][[q, q, q + 1, q + 1]]
                found += [four[[0, 1, 2]], four[[0, 2, 3]]] if (p + q) % 2 else [four[[0, 1, 3]], four[[1, 2, 3]]]
    return Yardstick(np.array(found), REFLECTIONS)


def sphere_errors(degree: int, ka: Array, divisions: int = 16) -> Array:
    """|p| of the yardstick over the closed form, less 1, of a sphere that moves as the harmonic of this degree.

    |p| = ρ₀c / (ka |h_l'(ka)| √(2l + 1)) at the radius, unit speed [Williams 1999, eq. 6.122].
    """
    body = octant_sphere(divisions)
    unit = body.corner_m / np.linalg.norm(body.corner_m, axis=-1, keepdims=True)
    moving = np.polynomial.legendre.legval(unit[..., 2], np.eye(degree + 1)[degree])
    speed = np.einsum("fci,fi->fc", unit, measures(body.corner_m)[1]) * moving
    sign = np.array([[g[2, 2] ** degree for g in REFLECTIONS]] * len(ka))
    level, _ = solve(body, np.repeat(speed[..., None], len(ka), axis=2), sign, ka * AIR.sound_speed_m_s / (2 * np.pi))
    hankel = spherical_jn(degree, ka, True) - 1j * spherical_yn(degree, ka, True)
    return np.asarray(level * ka * np.abs(hankel) * np.sqrt(2 * degree + 1) / RHO_C - 1)


def shapes_at(model: ModalModel, place: Array) -> Array:
    """Shapes (p, 3, m) of a model at places (p, 3) of its surface."""
    hit, barycentric, _ = nearest(surface_index(model.vertex_m, model.face), place, None)
    return np.asarray(np.einsum("pc,pcim->pim", barycentric, model.shape[model.face[hit]].astype(float)))


def characters(model: ModalModel, operation: tuple[Array, ...]) -> Array:
    """±1 (m, g): whether a mode is even or odd under each operation. Raises ValueError where it is neither."""
    place = model.vertex_m[:: max(1, len(model.vertex_m) // 400)]
    here, found = shapes_at(model, place), []
    for g in operation:
        turned, there = np.einsum("ij,pjm->pim", g, here), shapes_at(model, place @ g.T)
        found.append((turned * there).sum(axis=(0, 1)) / np.sqrt((turned**2).sum((0, 1)) * (there**2).sum((0, 1))))
    made = np.stack(found, axis=1)
    if np.abs(made).min() < 0.9:
        raise ValueError("a mode has none of the body's symmetries")
    return np.sign(made)


def strike_fractions(model: ModalModel) -> Array:
    """Largest part (m,) that each mode has of a strike's energy ½|φ·n F(ω)|², over 300 places."""
    corner = model.vertex_m[model.face]
    face = np.linspace(0, len(corner) - 1, min(300, len(corner))).astype(int)
    push = np.einsum("fi,fim->fm", measures(corner)[1][face], model.shape[model.face[face]].mean(axis=1))
    turns = 2 * model.freq_hz * PULSE_S  # half-sine [Harris & Piersol 2002, ch. 8]
    with np.errstate(divide="ignore", invalid="ignore"):
        pulse = np.where(np.abs(turns - 1) < 1e-6, np.pi / 4, np.cos(np.pi / 2 * turns) / (1 - turns**2))
    energy = (push * pulse) ** 2
    return np.asarray(
        (energy / np.maximum(energy.sum(axis=1, keepdims=True), 1e-9 * energy.sum(axis=1).max())).max(axis=0)
    )


def compare(name: str, model: ModalModel, body: Yardstick, chosen: Array, character: Array) -> tuple[Array, Array]:
    """Print a body's table; return the law's errors in dB and the parts of a strike's energy, of the modes chosen."""
    facing = np.repeat(measures(body.corner_m)[1], 3, axis=0)
    inside = body.corner_m + 1e-3 * (body.corner_m.mean(axis=1, keepdims=True) - body.corner_m)
    speed = np.einsum("pi,pim->pm", facing, shapes_at(model, inside.reshape(-1, 3))[:, :, chosen])
    speed = speed.reshape(-1, 3, len(chosen))
    truth, check = solve(body, speed, character, model.freq_hz[chosen])
    error = 20 * np.log10(np.abs(radiation(model, AIR)[0][chosen]) / truth)
    part = strike_fractions(model)[chosen]
    area = measures(body.corner_m)[0]
    square = len(body.operation) / 12 * area @ (9 * speed.mean(axis=1) ** 2 + (speed**2).sum(axis=1))
    sigma = 4 * np.pi * truth**2 / RHO_C**2 / square
    print(f"\n{name}: {len(model.face)} triangles of the model, {body.count} of the yardstick")
    print("     Hz         σ   law dB  powers dB  of a strike's energy")
    for m, at in enumerate(chosen):
        print(f"{model.freq_hz[at]:8.1f} {sigma[m]:9.2e} {error[m]:+8.2f} {check[m]:+10.2f} {part[m]:10.4f}")
    heard = np.abs(error[part >= 0.01])
    print(f"   median |{np.median(np.abs(error)):.2f}|, worst {np.abs(error).max():.2f} dB;", end=" ")
    print(f"worst of {len(heard)} modes with 1 % of a strike {heard.max(initial=0):.2f} dB", flush=True)
    return np.asarray(error), part


def bowl() -> tuple[ModalModel, Yardstick, Array]:
    """The bowl of assets with the motion of rim modes, u = (r/R)^n (cos nθ e_r - sin nθ/n e_θ) [Rayleigh 1894,
    sec. 235], at pitches of porcelain.
    """
    file = trimesh.load(Path(__file__).parent.parent / "assets" / "bowl.obj", process=False)
    vertex, face = np.array(file.vertices), np.array(file.faces)
    order = np.array([2, 3, 4, 5])
    radius, angle = np.hypot(vertex[:, 0], vertex[:, 1])[:, None], np.arctan2(vertex[:, 1], vertex[:, 0])[:, None]
    outward = (radius / 0.075) ** order * np.cos(order * angle)
    around = -((radius / 0.075) ** order) * np.sin(order * angle) / order
    cosine, sine = np.cos(angle), np.sin(angle)
    shape = np.stack([outward * cosine - around * sine, outward * sine + around * cosine, 0 * outward], axis=1)
    freq = np.array([2000.0, 5000.0, 8500.0, 12000.0])
    model = ModalModel(freq, np.ones(4), shape, vertex, face, np.zeros(len(face)), 1.0, 1.0)
    fine = file.subdivide()  # the same body
    corner = np.array(fine.vertices)[fine.faces]
    middle = corner.mean(axis=1)
    quarter = tuple(np.diag([x, y, 1.0]) for x in (1, -1) for y in (1, -1))
    sign = np.array([[g[0, 0] ** n for g in quarter] for n in order])
    return model, Yardstick(corner[(middle[:, 0] > 0) & (middle[:, 1] > 0)], quarter), sign


def bodies(coarse: bool) -> dict[str, tuple[tuple[float, ...], str, tuple[int, ...], float]]:
    """Size in m, preset, cells of a half-edge, band in Hz."""
    return {
        "plate 0.3 x 0.2 x 0.005, glass": ((0.3, 0.2, 0.005), "glass", (9, 6, 1) if coarse else (14, 9, 1), 8e3),
        "panel 0.4 x 0.3 x 0.002, aluminium": (
            (0.4, 0.3, 0.002), "aluminium", (12, 9, 1) if coarse else (18, 14, 1), 5e3),
        "bar 0.24 x 0.012 x 0.01, steel": ((0.24, 0.012, 0.01), "steel", (16, 1, 1) if coarse else (30, 2, 2), 20e3),
        "block 0.1 x 0.06 x 0.04, steel": ((0.1, 0.06, 0.04), "steel", (7, 5, 4) if coarse else (9, 6, 4), 20e3),
    }  # fmt: skip


def main(given: Sequence[str] | None = None) -> None:
    """Print the tables."""
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument(
        "--modes", type=int, default=24, help="modes of a body, the lowest and others spread over the rest"
    )
    parser.add_argument("--only", default="", help="bodies whose name holds this")
    parser.add_argument(
        "--coarse", action="store_true", help="a coarser yardstick, some 0.7 dB off, in a third of the time"
    )
    args = parser.parse_args(given)
    if args.only in "sphere":
        ka = np.array([0.1, 0.5, 1.0, 2.0, 4.0])
        for degree, name in enumerate(("monopole", "dipole", "quadrupole")):
            off = " ".join(f"{100 * one:+.2f}" for one in sphere_errors(degree, ka))
            print(f"sphere, {name}, ka 0.1 0.5 1 2 4: yardstick over closed form {off} %", flush=True)
    found = []
    for name, (size, material, cells, to_hz) in bodies(args.coarse).items():
        if args.only not in name:
            continue
        model = analyse((Shape("box", size_m=np.array(size)),), load_material(material), to_hz=to_hz)
        low = np.arange(min(args.modes // 2, model.mode_count))
        chosen = np.unique([*low, *np.linspace(0, model.mode_count - 1, args.modes - len(low)).astype(int)])
        found.append(compare(name, model, octant_box(size, cells), chosen, characters(model, REFLECTIONS)[chosen]))
    if args.only in "bowl":
        model, body, sign = bowl()
        found.append(compare("bowl, rim modes n = 2 ... 5", model, body, np.arange(4), sign))
    if found:
        error, part = (np.concatenate([one[at] for one in found]) for at in range(2))
        print(f"\nall: median |{np.median(np.abs(error)):.2f}| dB over {len(error)} modes; ", end="")
        print(f"worst with 1 % of a strike {np.abs(error[part >= 0.01]).max(initial=0):.2f} dB")


if __name__ == "__main__":
    main()
