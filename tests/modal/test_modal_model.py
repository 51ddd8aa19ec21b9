"""What every model keeps: normalisation, rigid modes, scaling, clamps, damping, cache, the same bits twice."""

from __future__ import annotations

from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest
import trimesh

from sonic_bullet.files.storage import cache as store
from sonic_bullet.modal import analyse, fem, lanczos
from sonic_bullet.modal.meshing import structured
from sonic_bullet.records import Material, Shape, isotropic_stiffness_pa
from sonic_bullet.records.errors import MeshError, ModalError
from sonic_bullet.records.mode_shapes import whole_multiples

SHAPE_BITS = 11

BAR = Shape("box", [0.2, 0.02, 0.02])


def quick(shape: Shape, material: Material, **more: object):  # type: ignore[no-untyped-def]
    return analyse((shape,), material, **{"count": 6, "edge_m": 0.02, "cache": None, **more})  # type: ignore[arg-type]


def test_six_rigid_modes_and_mass_normalised_shapes() -> None:
    solid = structured.box(np.array([0.2, 0.02, 0.02]), (10, 2, 2))
    stiffness, mass = fem.assemble(solid, isotropic_stiffness_pa(200e9, 0.3), 7850.0)
    modes = lanczos.solve(stiffness, mass, -1e7, rigid=6, enough=lambda v: len(v) >= 10, most=10)
    assert len(modes.rigid_per_s2) == 6
    assert np.abs(modes.rigid_per_s2).max() < 1e-6 * modes.lambda_per_s2[0]
    assert np.abs(modes.vector.T @ (mass @ modes.vector) - np.eye(modes.vector.shape[1])).max() < 1e-10
    assert np.abs(stiffness @ fem.rigid_modes(solid.node_m)).max() < 1e-9 * np.abs(stiffness.data).max()


def test_no_mode_is_missed() -> None:
    """Sylvester's law of inertia: as many negative pivots of K − μM as eigenvalues below μ [Parlett 1980, ch. 3.3]."""
    solid = structured.sphere(1.0, 2)
    stiffness, mass = fem.assemble(solid, isotropic_stiffness_pa(1.0, 0.3), 1.0)
    modes = lanczos.solve(stiffness, mass, -1.0, rigid=6, enough=lambda v: len(v) >= 40, most=40)
    inside = (modes.lambda_per_s2[30] + modes.lambda_per_s2[31]) / 2
    if modes.lambda_per_s2[31] - modes.lambda_per_s2[30] < 1e-6:
        inside = modes.lambda_per_s2[30] * 1.001
    below = (np.linalg.eigvalsh((stiffness - inside * mass).toarray()) < 0).sum()
    assert below == 6 + (modes.lambda_per_s2 < inside).sum()


@pytest.mark.parametrize(
    "shape",
    [
        Shape("sphere", [0.03, 0, 0]),
        Shape("box", [0.1, 0.05, 0.02]),
        Shape("cylinder", [0.02, 0.1, 0]),
        Shape("capsule", [0.02, 0.06, 0]),
    ],
    ids=lambda s: s.kind,
)
def test_named_shapes_have_their_volume_and_mass(shape: Shape, steel: Material) -> None:
    r, length = float(shape.size_m[0]), float(shape.size_m[1])
    ball = 4 / 3 * np.pi * r**3
    volume = {
        "sphere": ball,
        "box": float(np.prod(shape.size_m)),
        "cylinder": np.pi * r**2 * length,
        "capsule": ball + np.pi * r**2 * length,
    }[shape.kind]
    model = quick(shape, steel, count=3, edge_m=0.01)
    assert model.volume_m3 == pytest.approx(volume, rel=5e-3)
    assert model.mass_kg == pytest.approx(model.volume_m3 * 7850.0, rel=1e-12)
    a, b, c = (model.vertex_m[model.face[:, k]] for k in range(3))
    assert np.einsum("ij,ij->", a, np.cross(b, c)) / 6 == pytest.approx(volume, rel=4e-2)  # outward, closed


def test_scaling_laws(steel: Material) -> None:
    """f ∝ 1/s, shapes ∝ s^(−3/2); λ ∝ E/ρ, shapes ∝ ρ^(−1/2)."""
    one, twice = quick(BAR, steel), quick(Shape("box", [0.4, 0.04, 0.04]), steel, edge_m=0.04)
    assert np.allclose(twice.freq_hz, one.freq_hz / 2, rtol=1e-7)
    rms = [float(np.sqrt((m.shape[:, :, 0] ** 2).mean())) for m in (one, twice)]
    assert rms[1] == pytest.approx(rms[0] * 2**-1.5, rel=1e-5)
    light = quick(BAR, replace(steel, density_kg_m3=7850.0 / 4))
    assert np.allclose(light.omega0_squared_per_s2, 4 * one.omega0_squared_per_s2, rtol=1e-6)


def test_placed_and_turned_shapes_ring_alike(steel: Material) -> None:
    turned = Shape("box", BAR.size_m, position_m=[1.0, 2.0, -3.0], quaternion_xyzw=[0.5, 0.5, 0.5, 0.5])
    assert np.allclose(quick(turned, steel).freq_hz, quick(BAR, steel).freq_hz, rtol=1e-8)
    assert np.allclose(quick(turned, steel).vertex_m.mean(axis=0), [1, 2, -3], atol=1e-3)


def test_stiffness_is_a_tensor(steel: Material) -> None:
    """A bar stiff along x alone bends alike about y and z; made stiffer in Exx its bending rises, its twist hardly."""
    stiffness = np.array(steel.stiffness_pa)
    stiffness[0, 0] *= 2
    plain, fibred = quick(BAR, steel, count=8), quick(BAR, replace(steel, stiffness_pa=stiffness), count=8)
    assert fibred.freq_hz[0] > 1.2 * plain.freq_hz[0]
    assert fibred.freq_hz[0] == pytest.approx(fibred.freq_hz[1], rel=1e-3)


def test_clamped_bar_is_a_cantilever(steel: Material) -> None:
    """f₁ = 1.8751²/(2πL²)√(EI/ρA) [Rayleigh 1894, § 173]; nothing moves where it is held."""
    model = analyse(
        (Shape("box", [0.2, 0.01, 0.01]),), steel, count=2, edge_m=0.005, fixed=((-0.1, 0, 0, 0.0072),), cache=None
    )
    longest, shortest = (
        1.8751**2 / (2 * np.pi * free**2) * np.sqrt(200e9 * 0.01**2 / 12 / 7850) for free in (0.2, 0.2 - 0.0072)
    )
    assert longest < model.freq_hz[0] < shortest
    held = np.linalg.norm(model.vertex_m - [-0.1, 0, 0], axis=1) <= 0.0072
    assert held.any() and np.abs(model.shape[held]).max() == 0.0
    with pytest.raises(MeshError, match="does not touch"):
        analyse((BAR,), steel, count=1, edge_m=0.02, fixed=((5, 5, 5, 0.01),), cache=None)


def test_damping_bends_frequency_and_drops_overdamped_modes(steel: Material) -> None:
    free = quick(BAR, replace(steel, alpha_per_s=None, beta_s=None))
    assert np.isnan(free.decay_per_s).all()
    lam = free.omega0_squared_per_s2
    beta = 2.0 / (lam[3] * lam[4]) ** 0.25  # d = ω between modes 3 and 4
    damped = quick(BAR, replace(steel, alpha_per_s=0.0, beta_s=float(beta)))
    alive = np.flatnonzero((beta * lam / 2) ** 2 < lam)
    assert damped.mode_count == len(alive) and damped.dropped == 6 - len(alive) and damped.dropped > 0
    assert np.allclose(np.sort(damped.omega0_squared_per_s2), lam[alive], rtol=1e-6)


def test_modes_end_at_the_limit_and_a_marble_has_none(steel: Material) -> None:
    assert quick(Shape("sphere", [0.008, 0, 0]), steel, count=None, edge_m=0.003).mode_count == 0
    model = quick(BAR, steel, count=None, to_hz=7000.0)
    full = quick(BAR, steel, count=12)
    assert model.mode_count == (full.freq_hz <= 7000).sum() > 2
    assert quick(Shape("plane"), steel).mode_count == 0


def test_same_body_same_bytes_without_a_cache(steel: Material) -> None:
    ell = trimesh.creation.annulus(0.01, 0.02, 0.03, sections=12)
    ell.vertices[:, 2] *= 1 + 5 * ell.vertices[:, 0]  # neither box nor prism: Netgen's work
    shape = Shape("mesh", vertex_m=ell.vertices, face=ell.faces)
    one, two = (analyse((shape,), steel, count=4, edge_m=0.01, cache=None) for _ in range(2))
    assert "Netgen" in one.note
    assert one.shape.tobytes() == two.shape.tobytes() and one.freq_hz.tobytes() == two.freq_hz.tobytes()


def test_cache_gives_the_same_bits_and_survives_damage(
    steel: Material, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    fresh = quick(BAR, steel, cache=tmp_path)
    files = sorted(tmp_path.glob("*.npz"))
    assert len(files) == 2 and not list(tmp_path.glob("*partial*"))
    monkeypatch.setattr(lanczos, "solve", lambda *_, **__: pytest.fail("solved again"))
    again = quick(BAR, replace(steel, alpha_per_s=5.0), cache=tmp_path)  # damping alone does not solve again
    assert again.shape.tobytes() == fresh.shape.tobytes()
    monkeypatch.undo()
    for damage in (b"", b"PK\x03\x04rubbish", files[0].read_bytes()[:200]):
        for file in files:
            file.write_bytes(damage)
        assert quick(BAR, steel, cache=tmp_path).freq_hz.tobytes() == fresh.freq_hz.tobytes()
    assert store.load(tmp_path, "no-such-name") is None
    quick(BAR, steel, cache=Path("/proc/nowhere"))  # a cache that cannot be written costs nothing but time


@pytest.mark.parametrize("bad", [{"to_hz": float("nan"), "count": None}, {"count": 0}, {"fixed": ((0, 0, 0, -1),)}])
def test_bad_requests_are_named(steel: Material, bad: dict[str, object]) -> None:
    with pytest.raises(ModalError):
        quick(BAR, steel, **bad)


def test_shapes_are_rounded_when_they_are_solved_and_the_same_from_the_cache(tmp_path: Path, steel: Material) -> None:
    made = [quick(BAR, steel, cache=tmp_path) for _ in range(2)]
    assert made[0].shape.tobytes() == made[1].shape.tobytes()
    found = whole_multiples(made[0].shape)
    assert found is not None and np.abs(found[0]).max() <= 2**SHAPE_BITS
