"""A surface's form comes back from a log's header and arrays as it was."""

from __future__ import annotations

from dataclasses import replace
from pathlib import Path

import msgspec
import numpy as np
import pytest

from sonic_bullet.files.log_header import material_key
from sonic_bullet.files.presets import named_preset, write_preset
from sonic_bullet.files.rows.surface_forms import pack_form, track_arrays, unpack_form
from sonic_bullet.records.errors import SonicBulletError
from sonic_bullet.records.touching.surface_form import SurfaceForm, waves_of
from tests.apps.cli.test_commands import run
from tests.made.models import STEEL

TRACK_M = 1e-6 * np.random.default_rng(0).normal(size=50)


@pytest.mark.parametrize("form", [None, SurfaceForm(2e-6, 3e-3), SurfaceForm(0.0, 1e-3, TRACK_M, 2e-6)])
def test_a_form_comes_back(form: SurfaceForm | None) -> None:
    material = replace(STEEL, form=form)
    back = unpack_form(pack_form(form), track_arrays(3, material), 3, "log.npz")
    if form is None:
        assert back is None
        return
    assert back is not None
    assert (back.waviness_m, back.waviness_length_m) == (form.waviness_m, form.waviness_length_m)
    assert (back.track_m is None) == (form.track_m is None)
    if form.track_m is not None:
        np.testing.assert_array_equal(back.track_m, form.track_m)
        assert back.track_spacing_m == form.track_spacing_m
        other = replace(STEEL, form=SurfaceForm(0.0, 1e-3, -TRACK_M, 2e-6))
        assert material_key(material) != material_key(other), "two tracks are two materials"


def test_crests_are_those_of_a_sine_and_none_are_no_form() -> None:
    form = waves_of(2e-6, 2e-3)
    assert form is not None and form.crest_per_m == pytest.approx(np.sqrt(2) * 2e-6 * (2 * np.pi / 2e-3) ** 2)
    assert waves_of(0.0, 2e-3) is None


@pytest.mark.parametrize(
    "wrong",
    [{"waviness_m": -1.0}, {"waviness_m": 3e-4}, {"waviness_length_m": 0.0}, {"waviness_length_m": 2.0},
     {"track_m": [1.0]}, {"track_m": [0.0, np.nan]}, {"track_m": [0.0, 1.0], "track_spacing_m": 0.0}],
)  # fmt: skip
def test_what_is_no_form_is_one_line(wrong: dict[str, object]) -> None:
    with pytest.raises(SonicBulletError) as caught:
        SurfaceForm(**wrong)  # type: ignore[arg-type]
    assert "\n" not in str(caught.value)


def test_waves_higher_than_a_tenth_of_their_length_are_one_line_of_the_command(
    tmp_path: Path, capfd: pytest.CaptureFixture[str]
) -> None:
    preset = named_preset("steel")
    wavy = msgspec.structs.replace(preset.surface, waviness_m=1e300, waviness_length_m=2e-3)
    write_preset(tmp_path / "wavy.json", msgspec.structs.replace(preset, surface=wavy))
    scene = str(Path(__file__).resolve().parents[2] / "scenes" / "rolling.py")
    capfd.readouterr()
    assert run("render", scene, "-o", str(tmp_path / "a.wav"), "--material", str(tmp_path / "wavy.json")) == 2
    said = capfd.readouterr().err.strip()
    assert "waviness_m" in said and "a tenth of waviness_length_m" in said and "\n" not in said
