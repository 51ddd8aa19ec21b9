"""How far are the pressure weights of `radiation.far_field` from a boundary element solution of the same modes?

    python benchmarks/radiation_bem.py [--modes 14] [--only bar]

Dense Helmholtz boundary elements, constant on triangles, collocated at centroids, coupled after Burton & Miller 1971
(no irregular frequencies):
    (½ - K) φ - βDφ = S v + β(½ + K') v,   β = -i/max(k, 1/a),   p = iωρφ,   G = e^{-ikr}/4πr
Static kernels in closed form, the rest by 7 points a triangle. Prints, a line a mode: frequency, ka (a of the sphere of
equal area), σ, level error in dB of the law, and of the plain law of multipoles of that sphere (monopole, dipole, rest)
that it replaced. A body's line "power" compares the solution's own two powers, far field and surface: how good the
yardstick is.
"""

from __future__ import annotations

import argparse
from pathlib import Path

import numpy as np
import trimesh
from numba import njit
from scipy.special import spherical_jn, spherical_yn

from sonic_bullet.geometry import nearest, surface_index
from sonic_bullet.modal import analyse
from sonic_bullet.radiation.far_field import directions, radiation
from sonic_bullet.records import Air, Array, Material, ModalModel, Shape

AIR = Air()
RHO_C = AIR.density_kg_m3 * AIR.sound_speed_m_s
STEEL = Material.isotropic("steel", youngs_pa=200e9, poisson=0.29, density_kg_m3=7850)
# Seven points of degree 5 [Strang & Fix 1973, tab. 4.1].
_A, _B = (6 - 15**0.5) / 21, (6 + 15**0.5) / 21
POINTS = np.array([[1 / 3] * 3, *(np.roll([1 - 2 * x, x, x], i) for x in (_A, _B) for i in range(3))])
SHARES = np.array([9 / 40] + [(155 - 15**0.5) / 1200] * 3 + [(155 + 15**0.5) / 1200] * 3)


def static_kernels(corner: Array, normal: Array) -> tuple[Array, Array, Array, Array]:
    """S, K, K', D (f, f) at k = 0."""
    x = corner.mean(axis=1)
    arm = corner[None] - x[:, None, None]  # to the corners of j from i
    r = np.linalg.norm(arm, axis=-1)
    a, b, c = arm[:, :, 0], arm[:, :, 1], arm[:, :, 2]
    ra, rb, rc = r[..., 0], r[..., 1], r[..., 2]
    dot = lambda p, q: (p * q).sum(axis=-1)  # noqa: E731
    solid = -2 * np.arctan2(dot(a, np.cross(b, c)), ra * rb * rc + dot(a, b) * rc + dot(b, c) * ra + dot(c, a) * rb)
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
    return tuple(
        m / (4 * np.pi) for m in (potential, solid, dot(normal[:, None], gradient), -dot(normal[:, None], loop))
    )


@njit(cache=True, nogil=True)
def add_waves(k, corner, normal, area, points, shares, s, kk, ks, d):  # type: ignore[no-untyped-def]
    """Add to the static kernels (complex, in place) what k changes."""
    for i in range(len(area)):
        x = (corner[i, 0] + corner[i, 1] + corner[i, 2]) / 3
        for j in range(len(area)):
            both = normal[i, 0] * normal[j, 0] + normal[i, 1] * normal[j, 1] + normal[i, 2] * normal[j, 2]
            if i == j:
                d[i, j] += 0.5 * k * k * s[i, j] - 1j * k**3 / 3 * area[j] / (4 * np.pi)
                s[i, j] += -1j * k * area[j] / (4 * np.pi)
                continue
            for g in range(7):
                r0 = (
                    x[0]
                    - points[g, 0] * corner[j, 0, 0]
                    - points[g, 1] * corner[j, 1, 0]
                    - points[g, 2] * corner[j, 2, 0]
                )
                r1 = (
                    x[1]
                    - points[g, 0] * corner[j, 0, 1]
                    - points[g, 1] * corner[j, 1, 1]
                    - points[g, 2] * corner[j, 2, 1]
                )
                r2 = (
                    x[2]
                    - points[g, 0] * corner[j, 0, 2]
                    - points[g, 1] * corner[j, 1, 2]
                    - points[g, 2] * corner[j, 2, 2]
                )
                r = np.sqrt(r0 * r0 + r1 * r1 + r2 * r2)
                w = shares[g] * area[j] / (4 * np.pi)
                rx = (r0 * normal[i, 0] + r1 * normal[i, 1] + r2 * normal[i, 2]) / r
                ry = -(r0 * normal[j, 0] + r1 * normal[j, 1] + r2 * normal[j, 2]) / r
                kr = k * r
                wave = np.cos(kr) - 1j * np.sin(kr)
                first = (1 - wave * (1 + 1j * kr)) / (r * r)
                second = (wave * (2 + 2j * kr - kr * kr) - 2) / (r * r * r)
                s[i, j] += w * (wave - 1) / r
                kk[i, j] += w * first * ry
                ks[i, j] += w * first * rx
                d[i, j] += w * ((second - first / r) * rx * ry - first / r * both)


def solve(vertex: Array, face: Array, shape: Array, freq_hz: Array) -> tuple[Array, Array]:
    """√<|p|²> at 1 m (m,) and the surface power over the far field's, in dB, by boundary elements; unit modal
    velocity.
    """
    corner = np.ascontiguousarray(vertex[face])
    twice = np.cross(corner[:, 1] - corner[:, 0], corner[:, 2] - corner[:, 0])
    area = np.linalg.norm(twice, axis=1) / 2
    normal = np.ascontiguousarray(twice / (2 * area[:, None]))
    static = static_kernels(corner, normal)
    speed = np.einsum("fi,fcim->fcm", normal, shape[face].astype(float))
    place = np.einsum("gc,fci->fgi", POINTS, corner)
    direction, share = directions(24)
    direction, share = np.concatenate([direction, -direction]), np.concatenate([share, share])
    level, check = np.zeros(len(freq_hz)), np.zeros(len(freq_hz))
    for m, freq in enumerate(freq_hz):
        omega = 2 * np.pi * freq
        k = omega / AIR.sound_speed_m_s
        s, kk, ks, d = (one.astype(complex) for one in static)
        add_waves(k, corner, normal, area, POINTS, SHARES, s, kk, ks, d)
        beta = -1j / max(k, np.sqrt(4 * np.pi / area.sum()))
        v = speed[:, :, m]
        mean = v.mean(axis=1)
        phi = np.linalg.solve(0.5 * np.eye(len(area)) - kk - beta * d, s @ mean + beta * (0.5 * mean + ks @ mean))
        total = np.zeros(len(direction), complex)
        for g in range(7):
            wave = np.exp(1j * k * place[:, g] @ direction.T)
            weight = SHARES[g] * area
            total += (weight * (v @ POINTS[g])) @ wave + 1j * k * ((weight * phi) @ (wave * (normal @ direction.T)))
        square = share @ np.abs(1j * omega * AIR.density_kg_m3 / (4 * np.pi) * total) ** 2
        level[m] = np.sqrt(square)
        surface = 0.5 * np.real(np.sum(area * mean * 1j * omega * AIR.density_kg_m3 * phi))
        check[m] = 10 * np.log10(max(surface, 1e-300) / (2 * np.pi * square / RHO_C))
    return level, check


def multipoles(vertex: Array, face: Array, shape: Array, freq_hz: Array) -> tuple[Array, Array, Array]:
    """The law replaced: |p| at 1 m (m,) of monopole, dipole and the rest on the sphere of equal area; ka; ∮v² dS."""
    corner = vertex[face]
    twice = np.cross(corner[:, 1] - corner[:, 0], corner[:, 2] - corner[:, 0])
    area = np.linalg.norm(twice, axis=1) / 2
    normal = twice / (2 * area[:, None])
    speed = np.einsum("fi,fcim->fcm", normal, shape[face].astype(float))
    mean = speed.mean(axis=1)
    square = area @ (9 * mean**2 + (speed**2).sum(axis=1)) / 12
    monopole = (area @ mean) ** 2 / area.sum()
    shift = normal.T @ (area[:, None] * mean)
    dipole = np.minimum(
        np.einsum("im,ij,jm->m", shift, np.linalg.pinv(np.einsum("f,fi,fj->ij", area, normal, normal)), shift),
        square - monopole,
    )
    x = 2 * np.pi * freq_hz / AIR.sound_speed_m_s * np.sqrt(area.sum() / (4 * np.pi))
    efficiency = np.stack([x**2 / (1 + x**2), x**4 / (4 + x**4), x**6 / (81 + 9 * x**2 - 2 * x**4 + x**6)])
    power = (efficiency * np.stack([monopole, dipole, np.maximum(square - monopole - dipole, 0)])).sum(axis=0)
    return RHO_C * np.sqrt(power / (4 * np.pi)), x, square


def compare(
    name: str, model: ModalModel, mesh: tuple[Array, Array, Array] | None = None, exact: Array | None = None
) -> Array:
    """Print a body's table; return the law's errors in dB (m,)."""
    vertex, face, shape = mesh or (model.vertex_m, model.face, model.shape)
    truth, check = solve(vertex, face, shape, model.freq_hz)
    plain, ka, square = multipoles(model.vertex_m, model.face, model.shape, model.freq_hz)
    ours = np.abs(radiation(model, AIR)[0])
    sigma = 4 * np.pi * truth**2 / RHO_C**2 / square
    error, old = 20 * np.log10(ours / truth), 20 * np.log10(plain / truth)
    print(f"\n{name}: {len(model.face)} triangles of the model, {len(face)} of the yardstick")
    print(
        "     Hz      ka         σ   map dB  multipoles dB  power dB"
        + ("  yardstick - exact dB" if exact is not None else "")
    )
    for m in range(len(ka)):
        tail = f"  {20 * np.log10(truth[m] / exact[m]):+8.2f}" if exact is not None else ""
        print(
            f"{model.freq_hz[m]:8.1f} {ka[m]:6.2f} {sigma[m]:9.2e} {error[m]:+8.2f} {old[m]:+14.1f} "
            f"{check[m]:+9.2f}{tail}"
        )
    print(
        f"   map: median |{np.median(np.abs(error)):.2f}|, worst {np.abs(error).max():.2f} dB;  multipoles: "
        f"median |{np.median(np.abs(old)):.1f}|, worst {np.abs(old).max():.1f} dB",
        flush=True,
    )
    return np.asarray(error)


def sphere(radius: float, degree: int) -> tuple[ModalModel, Array]:
    ball = trimesh.creation.icosphere(3)
    vertex, face = np.array(ball.vertices), np.array(ball.faces)
    ka = np.array([0.1, 0.5, 1.0, 2.0, 4.0, 8.0])
    cosine = vertex[:, 2]
    shape = np.repeat(
        (vertex * np.polynomial.legendre.legval(cosine, np.eye(4)[degree])[:, None])[:, :, None], len(ka), axis=2
    )
    hankel = spherical_jn(degree, ka, True) - 1j * spherical_yn(degree, ka, True)
    exact = RHO_C * radius / (ka * np.abs(hankel)) / np.sqrt(2 * degree + 1)
    return ModalModel(
        ka * AIR.sound_speed_m_s / radius / (2 * np.pi),
        np.ones(6),
        shape,
        radius * vertex,
        face,
        np.zeros(len(face)),
        1.0,
        1.0,
    ), exact


def bowl() -> ModalModel:
    """The bowl of assets with the motion of rim modes, u = (r/R)^n (cos nθ e_r - sin nθ/n e_θ) [Rayleigh 1894,
    sec. 235], at pitches of porcelain.
    """
    file = trimesh.load(Path(__file__).parent.parent / "assets" / "bowl.obj", process=False)
    vertex, face = np.array(file.vertices), np.array(file.faces)
    order = np.array([2, 3, 4, 5])
    radius, angle = np.hypot(vertex[:, 0], vertex[:, 1])[:, None], np.arctan2(vertex[:, 1], vertex[:, 0])[:, None]
    outward, around = (
        (radius / 0.075) ** order * np.cos(order * angle),
        -((radius / 0.075) ** order) * np.sin(order * angle) / order,
    )
    shape = np.stack(
        [
            outward * np.cos(angle) - around * np.sin(angle),
            outward * np.sin(angle) + around * np.cos(angle),
            0 * outward,
        ],
        axis=1,
    )
    return ModalModel(
        np.array([2000.0, 5000.0, 8500.0, 12000.0]), np.ones(4), shape, vertex, face, np.zeros(len(face)), 1.0, 1.0
    )


def box_shape(*size: float) -> tuple[Shape, ...]:
    return (Shape("box", size_m=np.array(size)),)


def box_mesh(size: tuple[float, ...], cells: tuple[int, ...]) -> tuple[Array, Array]:
    """Vertices and outward triangles of a box, its edges divided into cells."""
    vertices, faces, count = [], [], 0
    for axis in range(3):
        u, v = np.meshgrid(*(np.linspace(-0.5, 0.5, cells[(axis + i) % 3] + 1) for i in (1, 2)), indexing="ij")
        a = np.arange(u.size).reshape(u.shape)
        quad = np.stack([a[:-1, :-1], a[1:, :-1], a[1:, 1:], a[:-1, 1:]], axis=-1).reshape(-1, 4)
        triangle = np.concatenate([quad[:, [0, 1, 2]], quad[:, [0, 2, 3]]])
        for side in (-0.5, 0.5):
            points = np.full((u.size, 3), side)
            points[:, (axis + 1) % 3], points[:, (axis + 2) % 3] = u.ravel(), v.ravel()
            faces.append(count + (triangle if side > 0 else triangle[:, ::-1]))
            vertices.append(points * size)
            count += u.size
    return np.concatenate(vertices), np.concatenate(faces)


def some_modes(model: ModalModel, index: list[int]) -> ModalModel:
    return ModalModel(
        model.freq_hz[index],
        model.decay_per_s[index],
        model.shape[:, :, index],
        model.vertex_m,
        model.face,
        model.curvature_per_m,
        model.volume_m3,
        model.mass_kg,
    )


def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("--modes", type=int, default=14, help="modes of a body, spread over its audible ones")
    parser.add_argument("--only", default="", help="bodies whose name holds this")
    args = parser.parse_args()
    errors = []
    for degree in range(4):
        if args.only in "sphere":
            model, exact = sphere(0.1, degree)
            errors.append(compare(f"sphere, l = {degree}", model, exact=exact))
    bodies = {
        "bar 0.24 x 0.01 x 0.01, steel": (
            box_shape(0.24, 0.01, 0.01),
            STEEL,
            box_mesh((0.24, 0.01, 0.01), (60, 2, 2)),
            20e3,
        ),
        "plate 0.2 x 0.2 x 0.004, steel": (
            box_shape(0.2, 0.2, 0.004),
            STEEL,
            box_mesh((0.2, 0.2, 0.004), (16, 16, 1)),
            8e3,
        ),
        "block 0.1 x 0.06 x 0.04, steel": (
            box_shape(0.1, 0.06, 0.04),
            STEEL,
            box_mesh((0.1, 0.06, 0.04), (15, 9, 6)),
            20e3,
        ),
    }
    for name, (shapes, material, (vertex, face), to_hz) in bodies.items():
        if args.only not in name:
            continue
        model = analyse(shapes, material, to_hz=to_hz)
        chosen = (
            np.unique(np.round(np.geomspace(1, model.mode_count, args.modes)).astype(int) - 1)
            if model.mode_count > args.modes
            else np.arange(model.mode_count)
        )
        model = some_modes(model, list(chosen))
        hit, barycentric, _ = nearest(surface_index(model.vertex_m, model.face), vertex, None)
        shape = np.einsum("vc,vcim->vim", barycentric, model.shape[model.face[hit]])
        errors.append(compare(name, model, (vertex, face, shape)))
    if args.only in "bowl":
        errors.append(compare("bowl, rim modes n = 2 ... 5", bowl()))
    every = np.abs(np.concatenate(errors))
    print(f"\nall: median |{np.median(every):.2f}|, worst {every.max():.2f} dB over {len(every)} modes")


if __name__ == "__main__":
    main()
