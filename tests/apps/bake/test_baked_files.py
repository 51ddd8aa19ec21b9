"""What a baked file holds comes back whole, and what does not fit is one line."""

from __future__ import annotations

import base64
import json
import struct
from collections.abc import Callable
from dataclasses import replace
from pathlib import Path
from typing import Any

import msgspec
import numpy as np
import pytest

import sonic_bullet as sb
from sonic_bullet.apps import bake
from sonic_bullet.apps.bake.baked_form import BAKED_FORMAT, BakedFile
from sonic_bullet.apps.bake.c_bank import c_bank_text, identifier
from sonic_bullet.files.storage.json_records import record_schema
from sonic_bullet.records.errors import FileError, MaterialError, ModalError, RecordError, SonicBulletError
from tests.made.models import STEEL, box_body
from tests.made.residuals import modes, residual

FREQ_HZ = (410.0, 1130.0, 2215.0, 2215.0, 7000.0)
REPO = Path(__file__).resolve().parents[3]


def model(**changes: Any) -> bake.BakedModel:
    return replace(bake.bake_body(box_body([0.2, 0.05, 0.01], FREQ_HZ)), **changes)


@pytest.mark.parametrize("end", ["json", "glb", "gltf"])
def test_everything_comes_back(tmp_path: Path, end: str) -> None:
    bent = np.arange(5) * 1e-3
    made = [
        model(bend_s2_m2=bent, damping_growth_s_m=2 * bent, damping_growth_power=2.0, notes=("a note",)),
        model(name="no triangles ë", face=np.zeros((0, 3), int), mass=None, material=bake.BakedMaterial()),
        model(pressure_pa_m=None, residual=residual(modes([500.0, 900.0]))),
    ]
    bake.write_baked(tmp_path / f"all.{end}", made)
    found = sb.read_baked(tmp_path / f"all.{end}")
    assert [one.name for one in found] == [one.name for one in made]
    for one, other in zip(found, made, strict=True):
        for field in ("freq_hz", "decay_per_s", "shape", "face", "pressure_pa_m", "bend_s2_m2", "damping_growth_s_m"):
            np.testing.assert_array_equal(getattr(one, field), getattr(other, field), err_msg=field)
        np.testing.assert_allclose(one.point_m, other.point_m, rtol=2**-24)
        for field in ("material", "damping_growth_power", "notes"):
            assert getattr(one, field) == getattr(other, field)
        assert (one.mass is None) == (other.mass is None)
        if one.mass is not None and other.mass is not None:
            np.testing.assert_array_equal(one.mass.inertia_kg_m2, other.mass.inertia_kg_m2)
        assert (one.residual is None) == (other.residual is None)


def test_another_program_reads_the_draft_s_own_fields(tmp_path: Path) -> None:
    """Without our words, glTF says the same to float32: numbers, mass, axes of inertia, elastic constants."""
    made = model()
    bake.write_baked(tmp_path / "own.gltf", [made])
    tree = json.loads((tmp_path / "own.gltf").read_text())
    del tree["extensions"]["KHR_audio_rigid_bodies"]["modalModels"][0]["extras"]
    (tmp_path / "plain.gltf").write_text(json.dumps(tree))
    (found,) = sb.read_baked(tmp_path / "plain.gltf")
    for field in ("freq_hz", "decay_per_s", "shape", "point_m"):
        np.testing.assert_array_equal(getattr(found, field), getattr(made, field).astype(np.float32), err_msg=field)
    assert found.pressure_pa_m is None
    assert found.mass is not None and made.mass is not None
    np.testing.assert_allclose(found.mass.inertia_kg_m2, made.mass.inertia_kg_m2, atol=1e-12)
    for field in ("name", "density_kg_m3", "youngs_pa", "poisson", "alpha_per_s", "beta_s"):
        assert getattr(found.material, field) == getattr(made.material, field)
    surface = tree["extensions"]["KHR_audio_rigid_bodies"]["acousticSurfaces"][0]
    assert surface["spectralSlope"] == pytest.approx(-(1 + 2 * STEEL.hurst))


def test_changed_accessors_count_more_than_our_words(tmp_path: Path) -> None:
    bake.write_baked(tmp_path / "a.gltf", [model()])
    tree = json.loads((tmp_path / "a.gltf").read_text())
    data = bytearray(base64.b64decode(tree["buffers"][0]["uri"].split(",")[1]))
    entry = tree["extensions"]["KHR_audio_rigid_bodies"]["modalModels"][0]
    view = tree["bufferViews"][tree["accessors"][entry["frequencies"]]["bufferView"]]
    data[view["byteOffset"] : view["byteOffset"] + 4] = struct.pack("<f", 333.0)
    tree["buffers"][0]["uri"] = "data:application/octet-stream;base64," + base64.b64encode(bytes(data)).decode()
    (tmp_path / "b.gltf").write_text(json.dumps(tree))
    assert sb.read_baked(tmp_path / "b.gltf")[0].freq_hz[0] == 333.0


def damaged(change: Callable[[dict[str, Any], dict[str, Any]], None]) -> Callable[[dict[str, Any]], None]:
    return lambda tree: change(tree, tree["extensions"]["KHR_audio_rigid_bodies"]["modalModels"][0])


def accessor(tree: dict[str, Any], entry: dict[str, Any], key: str) -> dict[str, Any]:
    found: dict[str, Any] = tree["accessors"][entry[key]]
    return found


def not_a_number(tree: dict[str, Any], entry: dict[str, Any]) -> None:
    view = tree["bufferViews"][accessor(tree, entry, "shapes")["bufferView"]]
    data = bytearray(base64.b64decode(tree["buffers"][0]["uri"].split(",")[1]))
    data[view["byteOffset"] : view["byteOffset"] + 4] = struct.pack("<f", float("nan"))
    tree["buffers"][0]["uri"] = "data:application/octet-stream;base64," + base64.b64encode(bytes(data)).decode()


WRONG: dict[str, tuple[Callable[[dict[str, Any]], None], str]] = {
    "short decays": (damaged(lambda t, e: accessor(t, e, "decayRates").update(count=4)), "4 decayRates, wanted 5"),
    "short shapes": (damaged(lambda t, e: accessor(t, e, "shapes").update(count=39)), "39 shapes, wanted 40"),
    "flat shapes": (damaged(lambda t, e: accessor(t, e, "shapes").update(type="VEC2")), "VEC2"),
    "whole frequencies": (damaged(lambda t, e: accessor(t, e, "frequencies").update(componentType=5125)), "5125"),
    "real indices": (damaged(lambda t, e: accessor(t, e, "indices").update(componentType=5126)), "5126"),
    "no shapes": (damaged(lambda t, e: e.pop("shapes")), "no shapes"),
    "accessor that is none": (damaged(lambda t, e: e.update(positions=99)), "accessor 99"),
    "negative accessor": (damaged(lambda t, e: e.update(positions=-1)), "accessor -1"),
    "indices that are no triangles": (damaged(lambda t, e: accessor(t, e, "indices").update(count=35)), "no triangles"),
    "NaN": (damaged(not_a_number), "numbers that are none"),
    "count beyond the buffer": (damaged(lambda t, e: accessor(t, e, "shapes").update(count=10**9)), "more bytes"),
    "a gigabyte that is not there": (lambda t: t["buffers"][0].update(byteLength=2**30), "shorter than it claims"),
    "no model": (lambda t: t["extensions"].clear(), "no modal model"),
    "mass of none": (damaged(lambda t, e: (e.pop("extras"), e["massProperties"].update(mass=0))[0]), "mass_kg"),
    "material that is none": (damaged(lambda t, e: (e.pop("extras"), e.update(material=7))[0]), "material is 7"),
    "our words damaged": (damaged(lambda t, e: e["extras"]["sonic_bullet"].update(modes=3)), "extras.sonic_bullet"),
    "frequency 0": (
        damaged(lambda t, e: (e.pop("extras"), e.update(frequencies=e["decayRates"], decayRates=e["frequencies"]),
                              t["bufferViews"][t["accessors"][e["frequencies"]]["bufferView"]].update(
                                  byteOffset=0, buffer=1), t["buffers"].append({"byteLength": 64, "uri":
                              "data:;base64," + base64.b64encode(bytes(64)).decode()}))[0]),
        "frequency is not above zero",
    ),
}  # fmt: skip


@pytest.mark.parametrize("case", WRONG)
def test_a_gltf_that_is_wrong_is_one_line(tmp_path: Path, case: str) -> None:
    change, said = WRONG[case]
    bake.write_baked(tmp_path / "a.gltf", [model()])
    tree = json.loads((tmp_path / "a.gltf").read_text())
    change(tree)
    (tmp_path / "a.gltf").write_text(json.dumps(tree))
    with pytest.raises(SonicBulletError, match=said) as caught:
        sb.read_baked(tmp_path / "a.gltf")
    assert "\n" not in str(caught.value)
    assert "a.gltf" in str(caught.value)


def test_a_glb_cut_short_or_lying_about_its_length(tmp_path: Path) -> None:
    bake.write_baked(tmp_path / "a.glb", [model()])
    whole = (tmp_path / "a.glb").read_bytes()
    lie = whole[:8] + struct.pack("<I", 2**30) + whole[12:]
    for content in (whole[:200], whole[: len(whole) // 2], lie[:1024], lie, b"glTF", b""):
        (tmp_path / "b.glb").write_bytes(content)
        with pytest.raises(FileError) as caught:
            sb.read_baked(tmp_path / "b.glb")
        assert len(str(caught.value)) < 400


@pytest.mark.parametrize(
    ("change", "said"),
    [
        (lambda body: body["modes"].update(freq_hz=[-1.0] * 5), "freq_hz"),
        (lambda body: body["modes"]["decay_per_s"].pop(), "decay_per_s"),
        (lambda body: body["shape_per_sqrt_kg"].pop(), "4 modes, but 5"),
        (lambda body: body["shape_per_sqrt_kg"][2].pop(), "mode 3 is at 7 of 8 points"),
        (lambda body: body["face"].append([0, 1, 8]), "names a point"),
        (lambda body: body["modes"].update(pressure_imag_pa_m=None), "pressure_imag_pa_m"),
        (lambda body: body.update(colour="red"), "colour"),
        (lambda body: body["material"].update(poisson=0.7), "poisson"),
    ],
)
def test_a_json_that_is_wrong_is_one_line(tmp_path: Path, change: Callable[[Any], None], said: str) -> None:
    bake.write_baked(tmp_path / "a.json", [model()])
    tree = json.loads((tmp_path / "a.json").read_text())
    change(tree["bodies"][0])
    (tmp_path / "a.json").write_text(json.dumps(tree))
    with pytest.raises((FileError, RecordError, MaterialError), match=said) as caught:
        sb.read_baked(tmp_path / "a.json")
    assert "\n" not in str(caught.value)


def test_the_schema_is_the_reader_s_own_and_says_every_field(tmp_path: Path) -> None:
    schema = json.loads(json.dumps(record_schema(BakedFile, BAKED_FORMAT)))
    assert json.loads((REPO / "docs" / "reference" / "baked.schema.json").read_text()) == schema
    bake.write_baked(tmp_path / "a.json", [model()])
    msgspec.json.decode((tmp_path / "a.json").read_bytes(), type=BakedFile)
    described = [part for one in schema["$defs"].values() for part in one.get("properties", {}).values()]
    assert sum("description" in part for part in described) > 30


def test_a_body_without_modes_and_a_wrong_name_are_said() -> None:
    with pytest.raises(ModalError, match="no modes"):
        bake.bake_body(box_body([0.1, 0.1, 0.1], ()))
    with pytest.raises(FileError, match=r"\.xml"):
        bake.write_baked("bowl.xml", [model()])
    with pytest.raises(FileError, match=r"\.h holds one"):
        bake.write_baked("bowl.h", [model(), model()])
    with pytest.raises(FileError, match="baked model"):
        sb.read_baked("bowl.h")
    with pytest.raises(ModalError, match="points"):
        bake.PruningOptions(points=2)


@pytest.mark.parametrize(
    ("name", "plain"),
    [("bowl", "bowl"), ("My Mug-2", "my_mug_2"), ("3d", "body_3d"), ("int", "body_int"), ("ë", "body")],
)
def test_names_become_those_of_c(name: str, plain: str) -> None:
    assert identifier(name) == plain
    assert f"static int {plain}_strike" in c_bank_text(model(name=name))


def test_modes_above_half_the_rate_make_no_sound() -> None:
    made = model()
    strike = bake.choose_strike(made)
    low = np.flatnonzero(made.freq_hz < 4000)
    assert len(low) == 4
    fewer = replace(
        made,
        freq_hz=made.freq_hz[low],
        decay_per_s=made.decay_per_s[low],
        shape=made.shape[:, :, low],
        pressure_pa_m=bake.strike_playback.pressure_of(made)[low],
    )
    np.testing.assert_array_equal(
        bake.render_strike(made, strike, 8_000, 1.0), bake.render_strike(fewer, strike, 8_000, 1.0)
    )
    one = replace(made, freq_hz=np.full(5, 9000.0))
    assert not bake.render_strike(one, strike, 8_000, 0.1).any()


def test_a_model_of_others_radiates_by_its_own_surface() -> None:
    """Of a box the same as the run time's: its points are the whole surface."""
    body = box_body([0.2, 0.05, 0.01], FREQ_HZ)
    made = bake.bake_body(body)
    other = replace(made, pressure_pa_m=None)
    strike = bake.choose_strike(made)
    one, two = bake.render_strike(made, strike, seconds=0.5), bake.render_strike(other, strike, seconds=0.5)
    assert ((one - two) ** 2).sum() < 1e-6 * (one**2).sum()
    with pytest.raises(ModalError, match="indices"):
        bake.render_strike(replace(other, face=np.zeros((0, 3), int)), strike)


@pytest.mark.shared
def test_models_of_the_draft_s_sample_scenes_are_read(shared_path: Path) -> None:
    scenes = sorted((shared_path / "gltf-audio").rglob("*.gltf"))
    if not scenes:
        pytest.skip("shared data not found: gltf-audio")
    models = 0
    for scene in scenes:
        if '"modalModels"' not in scene.read_text():
            continue
        for one in sb.read_baked(scene):
            models += 1
            assert np.isfinite(one.shape).all()
            assert one.mass is None or one.mass.mass_kg > 0
    print(f"{models} models of {len(scenes)} scenes")
    assert models > 20
