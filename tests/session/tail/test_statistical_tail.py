"""Modes above the last solved one: density and mobility of plates, energy at the seam, and what stays as it was."""

from __future__ import annotations

import json
from dataclasses import replace
from functools import cache
from pathlib import Path

import numpy as np
import pytest

from sonic_bullet._engine import compliance
from sonic_bullet.engine.contact.pulse_shape import spectrum_table
from sonic_bullet.files import read_model, write_model
from sonic_bullet.files.presets import load_material
from sonic_bullet.geometry.triangles import face_areas_m2, outward_normals
from sonic_bullet.radiation.radiated import radiation_of
from sonic_bullet.records import Air, Array, Material, ModalModel, Shape
from sonic_bullet.session.body_models import analyse_body
from sonic_bullet.session.tail.statistical_tail import with_tail
from tests.apps.cli.test_commands import run
from tests.few_cases import parametrize_few

METAL = Material.isotropic("metal", youngs_pa=70e9, poisson=0.33, density_kg_m3=2700, alpha_per_s=5.0, beta_s=1e-8)
SIDES_M = (0.4, 0.3, 0.004)
SHEET = Shape("box", np.array(SIDES_M))
STIFF = 70e9 * SIDES_M[2] ** 3 / 12 / (1 - 0.33**2)
SURFACE_KG_M2 = 2700 * SIDES_M[2]
MOBILITY = 1 / (8 * np.sqrt(STIFF * SURFACE_KG_M2))


@cache
def solved(count: int) -> ModalModel:
    return analyse_body((SHEET,), METAL, count=count, tail=False)


@cache
def filled(count: int) -> ModalModel:
    return with_tail(solved(count), METAL)


def inner_top(model: ModalModel) -> Array:
    x = np.abs(model.vertex_m) / np.array(SIDES_M)
    return np.flatnonzero((model.vertex_m[:, 2] > 0) & (x[:, 0] < 0.35) & (x[:, 1] < 0.35))


def thirds(model: ModalModel, power: Array, centres_hz: Array) -> Array:
    """Sums of (m,) in third octaves, in dB."""
    edge = centres_hz[:, None] * 2.0 ** (np.array([-1, 1]) / 6)
    return np.array(
        [10 * np.log10(power[(model.freq_hz >= low) & (model.freq_hz < high)].sum() + 1e-99) for low, high in edge]
    )


def sound(model: ModalModel, centres_hz: Array) -> Array:
    """Energy at 1 m of unit impulses in the interior, their mean, in third octaves."""
    weight, radiated = radiation_of(model, Air())
    struck = (model.shape[inner_top(model), 2].astype(float) ** 2).mean(axis=0)
    return thirds(model, struck * np.abs(weight) ** 2 / (model.decay_per_s + radiated), centres_hz)


def test_resonators_stand_for_as_many_modes_as_the_closed_form_has() -> None:
    """N = A/2 √(ρh/D) f of a thin plate, within 3 % to where its shear begins to count; beyond there are more."""
    model = filled(40)
    assert model.stands_for is not None
    seam = model.freq_hz[39]
    for top in (6000.0, 9000.0):
        above = (model.freq_hz > seam) & (model.freq_hz < top)
        want = SIDES_M[0] * SIDES_M[1] / 2 * np.sqrt(SURFACE_KG_M2 / STIFF) * (top - seam)
        assert model.stands_for[above].sum() == pytest.approx(want, rel=0.05)
    assert (np.diff(model.freq_hz) >= 0).all() and model.freq_hz[-1] < 20_000 and (model.stands_for[:40] == 1).all()
    assert "resonators for" in model.note and filled(40).note.startswith(solved(40).note)


def test_mobility_is_that_of_the_infinite_plate() -> None:
    """Re Y = π/2 Σφ² per rad/s, the mean over the interior, in third octaves above the seam: within 1 dB."""
    model = filled(40)
    centres = 4000 * 2.0 ** (np.arange(7) / 3)
    struck = (model.shape[inner_top(model), 2].astype(float) ** 2).mean(axis=0)
    span = 2 * np.pi * centres * (2 ** (1 / 6) - 2 ** (-1 / 6))
    level = thirds(model, np.pi / 2 * struck, centres) - 10 * np.log10(span * MOBILITY)
    assert np.abs(level).max() < 1.0


@pytest.mark.slow
def test_a_plate_sounds_alike_however_many_modes_are_solved() -> None:
    """40, 80 and 160 solved and the rest filled: third octaves within 2 dB, of the mean over the interior's strikes."""
    centres = 1000 * 2.0 ** (np.arange(13) / 3)
    levels = [sound(filled(count), centres) for count in (40, 80, 160)]
    for few in levels[:2]:
        assert np.abs(few - levels[2]).max() < 2.0


@parametrize_few("many", [80, 160])
def test_below_the_seam_what_is_filled_yields_as_much_as_what_it_stands_for(many: int) -> None:
    """Y = Σ φ² iΩ/(ω² - Ω² + 2idΩ), the exact sum over many modes, against 40 and the rest filled: within 1 dB.

    In third octaves from 100 to 400 Hz, mean over the interior; and alone what 40 leave out, Σ φ²/ω².
    """
    few, whole = 40, solved(many)
    cut = {name: getattr(whole, name)[..., :few] for name in ("freq_hz", "decay_per_s", "shape")}
    short = with_tail(replace(whole, **cut), METAL)
    assert np.array_equal(short.freq_hz[:few], whole.freq_hz[:few]) and short.freq_hz[few] > whole.freq_hz[few - 1]
    third, rest = [], []
    for model in (whole, short):
        square = model.shape[inner_top(model), 2].astype(float) ** 2
        left_out = (model.freq_hz > whole.freq_hz[few - 1]) & (model.freq_hz <= whole.freq_hz[-1])
        rest.append((square[:, left_out] / model.omega0_squared_per_s2[left_out]).sum(axis=1).mean())
        for centre in 100 * 2.0 ** (np.arange(7) / 3):
            big = 2 * np.pi * centre * 2.0 ** (np.linspace(-1, 1, 41)[:, None] / 6)
            driven = 1j * big / (model.omega0_squared_per_s2 - big**2 + 2j * model.decay_per_s * big)
            third.append((np.abs(square @ driven.T) ** 2).mean())
    level = 10 * np.log10(np.divide(*np.array(third).reshape(2, -1)))
    print(f"40 and the rest over {many}: {level} dB; what 40 leave out {10 * np.log10(np.divide(*rest)):.2f} dB")
    assert np.abs(level).max() < 1.0
    assert abs(10 * np.log10(np.divide(*rest))) < 1.0


def test_what_is_filled_keeps_the_volume() -> None:
    """∮ u·n dS = ∫ div u dV, which bending leaves at zero: of a thick bent plate, on whose rims waves end anyhow."""
    turn = np.linspace(0, np.pi, 13)
    ring = np.stack([np.cos(turn), np.sin(turn)], axis=1)
    corner = np.array([[*(r * ring[i]), z] for i in range(13) for r in (0.09, 0.1) for z in (0.0, 0.2)])
    quads = [(0, 1, 3, 2), (48, 50, 51, 49)]
    quads += [
        tuple(4 * i + np.array(q)) for i in range(12) for q in ((0, 4, 5, 1), (2, 3, 7, 6), (0, 2, 6, 4), (1, 5, 7, 3))
    ]
    bent = Shape(
        "mesh", vertex_m=corner, face=np.array([t for q in quads for t in ((q[0], q[1], q[2]), (q[0], q[2], q[3]))])
    )
    model = analyse_body((bent,), METAL, count=12, tail=True, cache=None)
    assert model.stands_for is not None
    area = face_areas_m2(model.vertex_m, model.face)[:, None] * outward_normals(model.vertex_m, model.face)
    swells = np.abs(np.einsum("fi,ficm->m", area / 3, model.shape[model.face].astype(float).transpose(0, 2, 1, 3)))
    moved = np.sqrt((model.shape.astype(float) ** 2).sum(axis=1).mean(axis=0)) * np.linalg.norm(area, axis=1).sum()
    assert (swells / moved)[model.stands_for > 1].max() < 1e-4 < (model.stands_for > 1).sum()


def test_a_draft_has_as_many_modes_as_the_full_sound_may_have() -> None:
    """Solved and stood for, 200 together; asked to be filled to the end, it goes to the end."""
    large = Shape("box", np.array((1.2, 0.9, 0.004)))
    draft, whole = (analyse_body((large,), METAL, draft=True, tail=tail, cache=None) for tail in (False, True))
    assert draft.stands_for is not None and whole.stands_for is not None
    assert 190 < draft.stands_for.sum() <= 200 < whole.stands_for.sum()
    assert whole.freq_hz[-1] > 18_000 > draft.freq_hz[-1]


def test_what_was_solved_stays_and_a_file_keeps_the_rest(tmp_path: Path) -> None:
    own, model = solved(40), filled(40)
    assert np.array_equal(model.freq_hz[:40], own.freq_hz) and np.array_equal(model.shape[:, :, :40], own.shape)
    again = with_tail(own, METAL)
    assert np.array_equal(again.shape, model.shape) and np.array_equal(again.decay_per_s, model.decay_per_s)
    write_model(tmp_path / "model.npz", model)
    kept = read_model(tmp_path / "model.npz")
    for name in ("freq_hz", "decay_per_s", "shape", "stands_for"):
        assert np.array_equal(getattr(kept, name), getattr(model, name))


def test_what_a_resonator_radiates_is_what_the_air_takes_of_it() -> None:
    """2Δd · ½|z|² = 4π |w z|²/2ρc, however many modes it stands for; each of them is damped as it is alone."""
    model, air = filled(40), Air()
    alone, many = radiation_of(replace(model, stands_for=None), air), radiation_of(model, air)
    assert model.stands_for is not None and np.allclose(many[1] * model.stands_for, alone[1], rtol=1e-12)
    radiated = 2 * np.pi * np.abs(many[0]) ** 2 / (air.density_kg_m3 * air.sound_speed_m_s)
    assert radiated == pytest.approx(many[1], rel=1e-9)


def test_a_quarter_of_the_resonators_sound_as_all() -> None:
    centres = 4000 * 2.0 ** (np.arange(7) / 3)
    every = 10 ** (sound(filled(40), centres) / 10)
    few = with_tail(solved(40), METAL, resonators_per_third=5)
    assert few.stands_for is not None and few.stands_for.max() > 4 and few.mode_count < filled(40).mode_count / 2
    assert 10 * np.log10((10 ** (sound(few, centres) / 10)).sum() / every.sum()) == pytest.approx(0, abs=1)


def test_a_ball_gives_the_plate_less_than_it_has() -> None:
    """By the run time's own law of compliant bodies: a pulse of 2mv gives its modes ½ Σ(JφF̂)² c², c = 1/(1 + mΣ/J²).

    5 mm of steel at 1 m/s: a free pulse would give 1.9 times ½mv² with the tail; it is 0.37 of it without.
    """
    mass, tau = 7850 * 4 / 3 * np.pi * 0.005**3, 35e-6
    row = spectrum_table()[0]
    given = []
    for model in (solved(40), filled(40)):
        shape = model.shape[inner_top(model), 2].astype(float)
        total = np.array([compliance(2 * mass * one, model.freq_hz, tau, row) for one in shape])
        given.append(0.5 * total / (1 + total / (4 * mass)) ** 2 / (0.5 * mass))
    assert given[0].max() <= 1 and given[1].max() <= 1
    assert given[1].mean() > given[0].mean()


def test_bulky_bodies_whole_bands_and_recorded_ones_have_none() -> None:
    block = analyse_body((Shape("box", np.array([0.05, 0.04, 0.03])),), METAL, count=8, tail=False)
    assert with_tail(block, METAL) is block
    assert with_tail(solved(40), METAL, to_hz=solved(40).freq_hz[-1]) is solved(40)
    spruce = analyse_body(
        (Shape("box", np.array([0.6, 0.4, 0.02])),), load_material("made-spruce"), count=20, tail=True
    )
    assert spruce.mode_count > 60 and np.isfinite(spruce.decay_per_s).all()


def test_a_lump_goes_on_as_dense_and_as_loud_as_its_modes() -> None:
    """A block whose modes are known to 120 and filled from 40 on: within a tenth, edges' own modes are left out."""
    sides = Shape("box", np.array([0.2, 0.16, 0.12]))
    block = analyse_body((sides,), METAL, count=120, to_hz=80_000.0, tail=False)
    cut = {name: getattr(block, name)[..., :40] for name in ("freq_hz", "decay_per_s", "shape")}
    slower = 8.0  # so that all are below 20 kHz
    cut["freq_hz"], top_hz = cut["freq_hz"] / slower, block.freq_hz[-1] / slower
    short = replace(block, **cut, volume_m3=block.volume_m3 * slower**3, vertex_m=block.vertex_m * slower)
    assert with_tail(short, METAL) is short
    grown = with_tail(short, METAL, top_hz, 200.0, lumps=True)
    assert grown.stands_for is not None and grown.stands_for.sum() == pytest.approx(120, rel=0.1)
    power = [(model.shape[..., 40:].astype(float) ** 2).sum(axis=(1, 2)).mean() for model in (block, grown)]
    assert abs(10 * np.log10(power[1] / power[0])) < 2.0


def test_modes_say_what_a_scene_adds(tmp_path: Path, monkeypatch: pytest.MonkeyPatch, capfd: object) -> None:
    import trimesh

    monkeypatch.chdir(tmp_path)
    trimesh.creation.box(SIDES_M).export("sheet.stl")
    assert run("modes", "sheet.stl", "--count", "12", "--material", "aluminium", "--json", "few.json") == 0
    assert run("modes", "sheet.stl", "--count", "12", "--material", "aluminium", "--tail", "--json", "all.json") == 0
    few, whole = (json.loads(Path(name).read_text())["modes"] for name in ("few.json", "all.json"))
    assert len(few) == 12 and len(whole) > 60 and whole[:12] == few
    assert "with --tail, or tail=True in a scene, above them" in capfd.readouterr().out  # type: ignore[attr-defined]


def test_a_thick_slab_of_wood_keeps_its_modes_in_order() -> None:
    """Its damping bends the highest frequencies back down."""
    wood = load_material("wood")
    model = analyse_body((Shape("box", np.array([0.4, 0.3, 0.04])),), wood, tail=False)
    grown = with_tail(model, wood)
    assert (np.diff(grown.freq_hz) >= 0).all()
    assert grown.freq_hz[: model.mode_count] == pytest.approx(model.freq_hz, rel=0)
