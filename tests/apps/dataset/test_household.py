"""The household: shapes, draws, holding, rooms, scaling, and one clip's way to its sound."""

from __future__ import annotations

from collections import Counter
from dataclasses import replace
from pathlib import Path
from typing import Any

import numpy as np
import pytest
import trimesh

from sonic_bullet.apps.dataset.household import household_recipe, recipe_of
from sonic_bullet.apps.dataset.household.clips import (
    CAUSES,
    PLACE_SCATTER_M,
    STRENGTH_SCATTER,
    HouseholdClip,
    draw_change,
    draw_clip,
    draw_take,
)
from sonic_bullet.apps.dataset.household.holding import held_model
from sonic_bullet.apps.dataset.household.materials import CLASS_OF, LOSS_FACTORS, specimen, wood_loss
from sonic_bullet.apps.dataset.household.objects import KINDS, WALLS_M, DrawnObject, draw_object, shape_of
from sonic_bullet.apps.dataset.household.solved import TO_HZ, object_of_size
from sonic_bullet.apps.dataset.household.sounding import (
    body_of,
    feet_of,
    scale_shape,
    sound_of,
    struck_log,
    struck_place,
)
from sonic_bullet.apps.dataset.household.surroundings import DrawnRoom, draw_room, noise_of, noise_rms_pa, room_response
from sonic_bullet.apps.dataset.making import DatasetSummary, make_dataset
from sonic_bullet.apps.dataset.recipes import Recipe
from sonic_bullet.effects.damping_law import own_decay_per_s
from sonic_bullet.files.contact_log import ContactLog
from sonic_bullet.options.dataset import DatasetOptions, HouseholdOptions
from sonic_bullet.radiation.radiated import radiation_and_note, radiation_of
from sonic_bullet.records import Air, Array, ModalModel
from sonic_bullet.records.errors import SceneError
from sonic_bullet.session.body_models import analyse_body

OPTIONS = HouseholdOptions(objects=3, seconds=0.5)
TILE = DrawnObject("tile-1", "tile", "porcelain", 0.004, 1)


def tile_clip(**changes: Any) -> HouseholdClip:
    clip = draw_clip(np.random.default_rng(1), OPTIONS)
    while clip.striker is None:
        clip = draw_clip(np.random.default_rng(clip.seed), OPTIONS)
    return replace(clip, object=TILE, size=0.8, support="hung", fingers_n_s_m=(), **changes)


@pytest.mark.parametrize("kind", KINDS)
def test_shapes_are_closed(kind: str) -> None:
    of = KINDS[kind]
    for material in of.materials:
        for wall_m in WALLS_M[material]:
            for seed in range(2):
                shape = of.build(np.random.default_rng(seed), wall_m)
                if shape.kind != "mesh":
                    assert (shape.size_m > 0).all()
                    continue
                made = trimesh.Trimesh(shape.vertex_m, shape.face, process=False)
                if of.sheet:
                    assert not made.is_watertight and (made.face_normals[:, 2] > 0).all()
                    continue
                assert made.is_watertight and made.volume > 0, (material, wall_m, seed)
                assert np.abs(made.center_mass).max() < 1e-3 * made.scale


def test_every_class_is_drawn_as_often() -> None:
    drawn = [draw_object(np.random.default_rng(seed)) for seed in range(800)]
    counts = Counter(CLASS_OF[one.material] for one in drawn)
    assert counts.keys() == set(CLASS_OF.values()) and min(counts.values()) > 115  # 160 each, ± 4 deviations
    assert {one.material for one in drawn} == set(CLASS_OF) and {one.kind for one in drawn} == KINDS.keys()
    assert {draw_object(np.random.default_rng(seed), ("cup",)).kind for seed in range(20)} == {"cup"}


def test_a_draw_depends_on_its_seed_alone() -> None:
    first, again, other = (draw_clip(np.random.default_rng(seed), OPTIONS) for seed in (5, 5, 6))
    assert first == again
    assert first.parameters() != other.parameters()


COLUMNS = {
    "material": {"material", "class"},
    "size": {"size"},
    "wall": {"wall_m"},
    "hammer": {"excitation", "striker_youngs_pa", "striker_radius_m", "striker_mass_kg"},
    "height": {"speed_m_s", "height_m"},
    "support": {"support", "fingers_n_s_m"},
    "room": {"room_volume_m3", "room_t60_s", "seeds"},
    "none": set(),
}


def test_a_counterfactual_differs_in_its_cause_alone() -> None:
    assert COLUMNS.keys() == CAUSES.keys()
    seen = set()
    for seed in range(200):
        rng = np.random.default_rng(seed)
        clip = draw_clip(rng, OPTIONS)
        cause, other = draw_change(clip, rng)
        before, after = clip.parameters(), other.parameters()
        changed = {name for name in before if before[name] != after[name]}
        assert bool(changed) == (cause != "none") and changed <= COLUMNS[cause], cause
        seen.add(cause)
    assert seen == CAUSES.keys()


def test_takes_scatter_in_strength_and_place_and_nothing_else() -> None:
    clip = tile_clip()
    assert draw_take(clip, 0) == clip
    takes = [draw_take(clip, k) for k in range(1, 200)]
    factor = np.log([take.speed_m_s / clip.speed_m_s for take in takes])
    assert factor.std() == pytest.approx(STRENGTH_SCATTER, rel=0.2)
    assert all(replace(take, take=0, speed_m_s=clip.speed_m_s, load_n=clip.load_n) == clip for take in takes)
    model = body_of(clip, OPTIONS)[1]
    first, normal = struck_place(clip, OPTIONS, model)
    aside = np.array([struck_place(take, OPTIONS, model)[0] for take in takes]) - first
    along = aside[:, np.abs(normal) < 0.5]
    assert along.std() == pytest.approx(PLACE_SCATTER_M, rel=0.2)


def test_another_material_is_struck_at_the_same_place() -> None:
    clip = tile_clip()
    other = replace(clip, object=replace(TILE, material="wood", wall_m=0.004))
    model = body_of(other, OPTIONS, clip)[1]
    own, aimed = struck_place(clip, OPTIONS, body_of(clip, OPTIONS)[1])[0], struck_place(other, OPTIONS, model, clip)[0]
    assert np.linalg.norm(own - aimed) < 1e-4


def two_modes(freq_hz: tuple[float, float]) -> ModalModel:
    """A triangle of which two modes move alike at its second corner, one along x and one along y."""
    shape = np.zeros((3, 3, 2), np.float32)
    shape[1, 0, 0], shape[1, 1, 1] = 2.0, 2.0
    shape[2, 0] = (3.0, 3.0)
    model = ModalModel(
        freq_hz=np.array(freq_hz), decay_per_s=np.array([1.0, 1.0]), shape=shape,
        vertex_m=np.array([[0.0, 0, 0], [1, 0, 0], [0, 1, 0]]), face=np.array([[0, 1, 2]]),
        curvature_per_m=np.zeros(1), volume_m3=1e-3, mass_kg=1.0,
    )  # fmt: skip
    radiation_and_note.put(model, (np.array([1 + 1j, 2j]), np.array([0.1, 0.2]), ""), Air(), "default")
    return model


def test_fingers_add_half_c_phi_squared() -> None:
    model = two_modes((500.0, 900.0))
    held = held_model(model, np.array([[1.0, 0, 0]]), np.array([3.0]), Air())
    assert held.decay_per_s == pytest.approx([1 + 0.5 * 3 * 4] * 2)
    assert np.array_equal(held.shape, model.shape)


def test_a_finger_leaves_one_of_a_pair_alone_where_both_move_alike() -> None:
    model = two_modes((500.0, 500.0001))
    held = held_model(model, np.array([[0.0, 1.0, 0]]), np.array([2.0]), Air())
    assert sorted(held.decay_per_s - 1) == pytest.approx([0.0, 2 * 9.0], abs=1e-5)  # C has 18 along (1, 1), 0 across
    for one, other in zip(radiation_of(held, Air()), radiation_of(model, Air()), strict=True):
        assert np.array_equal(one, other)


def test_a_room_has_its_energy_and_its_decay() -> None:
    sr, room = 24_000, DrawnRoom(40.0, (0.6,) * 8, 3)
    made = room_response(room, 0.5, sr)
    late = made[1:]
    rate = np.log(1e3) / 0.6
    begin = round(2.5e-3 * sr)
    wanted = (0.5 / 0.057) ** 2 * 0.6 / 40.0 * np.exp(-2 * rate * begin / sr)
    assert made[0] == 1.0 and not made[1:begin].any()
    assert (late**2).sum() == pytest.approx(wanted, rel=0.1)
    left = 10 * np.log10(np.cumsum(late[::-1] ** 2)[::-1])
    at = [int(np.argmax(left <= left[0] + db)) for db in (-5, -25)]
    assert (at[1] - at[0]) / sr * 3 == pytest.approx(0.6, rel=0.1)
    assert max(draw_room(np.random.default_rng(0)).t60_s[6:]) < 5.2  # the air's own


def test_half_of_the_rooms_are_studios() -> None:
    drawn = [draw_room(np.random.default_rng(seed)) for seed in range(400)]
    studio = np.array([0.25 * (one.volume_m3 / 100) ** (1 / 3) for one in drawn])
    near = np.abs(np.log(np.array([one.t60_s[3] for one in drawn]) / studio)) < 0.5  # ± 0.05 s, and octaves' spread
    assert 0.5 < near.mean() < 0.65  # 5 to 15 % of dwellings are as dry


def test_a_bar_is_thicker_than_a_board_and_as_thick_for_its_wall_as_it_is_wide() -> None:
    for seed in range(20):
        thin, thick = (shape_of("bar", wall, seed).size_m for wall in (1e-3, 4e-3))
        assert thick[2] == pytest.approx(2 * thin[2]) and np.array_equal(thin[:2], thick[:2])
        assert 3e-3 < thin[2] < thin[1] < thin[0]


def test_noise_has_its_level_and_slope() -> None:
    noise = noise_of(0.01, -6.0, 16_000, 256_000, 1)
    power = np.abs(np.fft.rfft(noise)) ** 2  # bins of 1/16 Hz
    assert np.sqrt(2 * power[16 * 50 :].sum()) / len(noise) == pytest.approx(0.01)  # what is heard; rumble comes on top
    low, high = (power[16 * f : 32 * f].mean() for f in (250, 1000))
    assert 10 * np.log10(low / high) == pytest.approx(12, abs=0.7)
    below, rumble, heard = (power[16 * f : 20 * f].mean() for f in (8, 20, 80))
    assert 10 * np.log10(rumble / heard) == pytest.approx(12, abs=1.5)
    assert 10 * np.log10(below / rumble) == pytest.approx(20 * np.log10(22.5 / 16), abs=2)  # level below 16 Hz


def test_noise_is_the_rooms_own_or_keeps_below_a_faint_peak() -> None:
    assert noise_rms_pa(34.0, 1.0) == pytest.approx(2e-5 * 10**1.7)
    assert noise_rms_pa(34.0, 0.005) == pytest.approx(0.0005)


def test_a_specimen_loses_what_its_material_does() -> None:
    """Glass once lost as much as plastic, with what measured bodies lose by their supports."""
    assert LOSS_FACTORS.keys() == CLASS_OF.keys()
    omega = 2 * np.pi * np.array([500.0, 4000.0])
    for name, (low, high) in LOSS_FACTORS.items():
        made = [specimen(name, *(np.random.default_rng([seed, k]) for k in (0, 1))) for seed in range(20)]
        eta = np.array([2 * own_decay_per_s(one, omega**2) / omega for one in made])
        if name == "wood":
            eta /= np.array([wood_loss(one.youngs_pa, one.density_kg_m3) for one in made])[:, None]
        assert eta.min(axis=1) == pytest.approx(eta.max(axis=1)) and low <= eta.min() and eta.max() <= high
        assert np.ptp(np.log(eta)) > 0.5 * np.log(high / low) and not any(one.includes_radiation for one in made)


def test_wood_loses_most_where_it_is_soft() -> None:
    """Spruce, E/ρ = 25 GPa per g/cm³ along the grain and a tenth of it across: 0.0066 and 0.03."""
    assert wood_loss(11e9, 440.0) == pytest.approx(0.0066, rel=0.02)
    assert wood_loss(1.1e9, 440.0) == pytest.approx(0.0066 * 10**0.68, rel=0.02)


def test_a_size_scales_as_its_own_solution() -> None:
    elastic = specimen("porcelain", np.random.default_rng(1), np.random.default_rng(2))
    large, small = (object_of_size(TILE, size, elastic) for size in (1.0, 0.5))
    own = analyse_body(
        (scale_shape(shape_of("tile", TILE.wall_m, TILE.seed), 0.5),), elastic, to_hz=2 * TO_HZ, accuracy=0.1
    )
    assert small.mode_count == own.mode_count == large.mode_count > 3
    assert small.freq_hz == pytest.approx(own.freq_hz)
    assert small.freq_hz == pytest.approx(2 * large.freq_hz)
    assert small.decay_per_s == pytest.approx(own.decay_per_s)
    assert np.abs(small.shape).max() == pytest.approx(np.abs(own.shape).max(), rel=5e-4)  # rounded
    assert small.mass_kg == pytest.approx(own.mass_kg)
    for scaled_one, solved in zip(radiation_of(small, Air()), radiation_of(own, Air()), strict=True):
        assert np.abs(scaled_one) == pytest.approx(np.abs(solved), rel=2e-3, abs=1e-3 * np.abs(solved).max())


def test_it_stands_on_three_of_its_lowest_points() -> None:
    _, model = body_of(tile_clip(), OPTIONS)
    feet = feet_of(model)
    assert feet[:, 2] == pytest.approx(model.vertex_m[:, 2].min())
    assert np.linalg.norm(np.cross(feet[1] - feet[0], feet[2] - feet[0])) > 0.2 * np.ptp(model.vertex_m[:, 0]) ** 2 / 4


def test_a_strike_gives_its_impulse() -> None:
    clip = tile_clip()
    material, model = body_of(clip, OPTIONS)
    log = struck_log(clip, OPTIONS, material, model, 24_000, 0)
    assert clip.striker is not None
    reduced = 1 / (1 / model.mass_kg + 1 / clip.striker.mass_kg)
    wanted = (1 + material.restitution * clip.striker.restitution) * reduced * clip.speed_m_s
    assert len(log.rows.row) == 1
    assert np.linalg.norm(log.rows.row["impulse_n_s"][0]) == pytest.approx(wanted)
    assert log.rows.row["approach_m_s"][0] == pytest.approx(clip.speed_m_s)


def test_slow_strikes_sound_where_things_lie(tmp_path: Path) -> None:
    """The run time once took a slow strike on what lies for its load."""
    from sonic_bullet.engine.runtime.replay import render_log

    clip = replace(tile_clip(), support="stone", speed_m_s=0.1)
    material, model = body_of(clip, OPTIONS)
    assert np.abs(render_log(struck_log(clip, OPTIONS, material, model, 24_000, 0))).max() > 0


def tin_clip(excitation: str, material: str, **changes: Any) -> HouseholdClip:
    options = replace(OPTIONS, kinds=("tin",), excitations=(excitation,))
    clip = draw_clip(np.random.default_rng(1), options)
    return replace(clip, object=DrawnObject("tin-1", "tin", material, 0.002, 1), support="wood", **changes)


def heard(clip: HouseholdClip) -> tuple[Array, ContactLog]:
    options = replace(OPTIONS, without=("room", "chain"), seconds=0.8)
    return sound_of(clip, options, 16_000, 1)


def test_a_tin_that_rolls_weighs_on_the_ground_all_the_while() -> None:
    sound, log = heard(tin_clip("rolled", "steel", speed_m_s=0.4))
    last = log.steps[-144:]  # of 480 a second
    pushed = sum(float(np.abs(step.contacts.row["impulse_n_s"][:, 2]).sum()) for step in last)
    [mass_kg] = [one.mass_kg for one in log.bodies if one.name == "object"]
    assert pushed == pytest.approx(mass_kg * 9.81 * 0.3, rel=0.05)
    assert np.abs(sound[0, -4000:]).max() > 0


def test_a_scraping_tip_is_louder_when_it_is_faster() -> None:
    slow, fast = (heard(tin_clip("scraped", "steel", speed_m_s=v, load_n=2.0))[0] for v in (0.05, 0.4))
    assert 0 < np.sqrt((slow**2).mean()) < np.sqrt((fast**2).mean())


def test_what_is_shaken_keeps_its_pieces_and_is_louder_when_it_is_faster() -> None:
    """Of three seeds and both speeds, all pieces stay between floor and palm, and meet the vessel."""
    for seed in range(3):
        rms_pa = []
        for speed_m_s in (0.4, 1.5):
            sound, log = heard(replace(tin_clip("shaken", "steel", speed_m_s=speed_m_s, pieces=4), place_seed=seed))
            [vessel] = [k for k, one in enumerate(log.bodies) if one.name == "object"]
            pieces = [k for k, one in enumerate(log.bodies) if one.name.startswith("piece")]
            assert len(pieces) == 4
            assert log.bodies[vessel].model is not None
            low, high = log.bodies[vessel].model.vertex_m.min(axis=0), log.bodies[vessel].model.vertex_m.max(axis=0)
            for step in log.steps:
                at = step.position_m[pieces]
                assert (at > low).all()
                assert (at < high).all()
            met = log.rows.row[["a", "b"]].tolist()
            assert {one for pair in met if vessel in pair for one in pair} >= set(pieces)
            rms_pa.append(float(np.sqrt((sound**2).mean())))
        assert 0 < rms_pa[0] < rms_pa[1]


def asked(**household: Any) -> DatasetOptions:
    return DatasetOptions(folder="out", count=1, seed=2, household=HouseholdOptions(**household))


def test_options_belong_to_the_household() -> None:
    assert household_recipe("impacts", asked()) is None
    with pytest.raises(SceneError, match="impacts takes no --objects"):
        household_recipe("impacts", asked(objects=3))
    with pytest.raises(SceneError, match="no cups"):
        household_recipe("household", asked(kinds=("cups",)))
    with pytest.raises(SceneError, match="kicked"):
        household_recipe("household", asked(excitations=("kicked",)))
    with pytest.raises(SceneError, match="not all that is drawn rolls"):
        household_recipe("household", asked(excitations=("rolled",), kinds=("tin", "plate")))
    with pytest.raises(SceneError, match="not all that is drawn holds what rattles"):
        household_recipe("household", asked(excitations=("shaken",), kinds=("tin", "plate")))
    with pytest.raises(SceneError, match="without rooms"):
        household_recipe("household", asked(without=("rooms",)))
    assert household_recipe("household", asked(objects=3)) == recipe_of(HouseholdOptions(objects=3, seed=2))


def contents(folder: Path) -> dict[Path, bytes]:
    return {one.relative_to(folder): one.read_bytes() for one in folder.rglob("*") if one.is_file()}


def household(**options: Any) -> Recipe:
    return recipe_of(HouseholdOptions(objects=2, seconds=0.3, seed=4, **options))


def make(folder: Path, recipe: Recipe, count: int, workers: int = 1) -> DatasetSummary:
    options = DatasetOptions(
        folder=str(folder), count=count, seed=4, sr=8000, workers=workers, formats=("audiofolder",)
    )
    return make_dataset(recipe, folder, options)


def test_workers_and_interruptions_change_no_byte(tmp_path: Path) -> None:
    for count in (1, 3):  # stopped after the first, and gone on
        made = make(tmp_path / "one", household(), count)
    assert made.made == 2 and not made.failures
    make(tmp_path / "two", household(), 3, workers=2)
    assert contents(tmp_path / "one") == contents(tmp_path / "two")
    card = (tmp_path / "one" / "audiofolder" / "README.md").read_text()
    assert card.startswith("---\n") and "- `striker_mass_kg`" in card and "3 samples" in card


def test_a_pair_is_one_sample_of_as_many_channels_as_takes(tmp_path: Path) -> None:
    assert not make(tmp_path / "pairs", household(counterfactual=True), 1).failures
    [labels] = [one.read_text() for one in tmp_path.rglob("000000.json")]
    assert '"channels":10' in labels and '"cause":"' in labels and '"other":{' in labels
