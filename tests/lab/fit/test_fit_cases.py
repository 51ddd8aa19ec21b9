"""Cases as people hand them in: several objects of one material, meshes in millimetres, one strike, files that
contradict one another.
"""

from __future__ import annotations

import json
from dataclasses import replace
from pathlib import Path
from typing import Any

import numpy as np
import pytest
import soundfile

from sonic_bullet import modal
from sonic_bullet.files.cases import Case, CaseRecording, read_case
from sonic_bullet.lab.fit.material_fit import fit_case, fit_evidence
from sonic_bullet.lab.fit.recorded import RecordedObject, describe_observation, gather
from sonic_bullet.records import Material
from sonic_bullet.records.errors import AudioError, MeshError, SonicBulletError
from tests.few_cases import parametrize_few
from tests.made.case import Planted, make, write_box

BRASS = Material.isotropic("made", youngs_pa=1.04e11, poisson=0.345, density_kg_m3=8500, alpha_per_s=6.0, beta_s=3e-8)
GUESS = (1.25e11, 8000.0, 0.31)
SIZES = {"bar": (0.14, 0.03, 0.005), "plate": (0.11, 0.08, 0.006)}


@pytest.fixture(scope="module")
def planted(tmp_path_factory: pytest.TempPathFactory) -> Planted:
    return make(tmp_path_factory.mktemp("box"), BRASS, guess=GUESS, strikes=3, seconds=0.4)


def described(
    folder: Path, names: tuple[str, ...], *, units: str, to_hz: float = 9_000.0, tolerance: float | None = None
) -> Case:
    """Measured lines of boxes of brass, frequencies to 1e-4 and decays to 1 %; meshes in the unit named, whose
    dimensions are known to a tolerance.
    """
    rng = np.random.default_rng(8)
    scale = {"m": 1.0, "mm": 1000.0}[units]
    objects: dict[str, Any] = {}
    recordings = []
    for name in names:
        size = SIZES[name]
        write_box(folder / f"{name}.obj", (size[0] * scale, size[1] * scale, size[2] * scale))
        guess = dict(zip(("youngs_modulus", "density", "poisson_ratio"), GUESS, strict=True))
        objects[name] = {"mesh": f"{name}.obj", "units": units, "material": "brass", "elastic_guess": guess}
        write_box(folder / f"{name}_m.obj", size)
        model = modal.analyse((modal.read_mesh(folder / f"{name}_m.obj"),), BRASS, to_hz=to_hz)
        f, d = (
            model.freq_hz * (1 + 1e-4 * rng.standard_normal(len(model.freq_hz))),
            model.decay_per_s * (1 + 0.01 * rng.standard_normal(len(model.freq_hz))),
        )
        lines = [
            {
                "freq_hz": float(x),
                "freq_sd_hz": 1e-4 * float(x),
                "decay_per_s": float(y),
                "decay_sd_per_s": 0.01 * float(y),
            }
            for x, y in zip(f, d, strict=True)
        ]
        recordings.append({"features": lines, "object": name, "split": "fit"})
    case = {"format": "sonic-bullet-case/1", "objects": objects, "recordings": recordings}
    (folder / "case.json").write_text(json.dumps(case | {"dimension_tolerance": tolerance}))
    return read_case(folder)


def test_two_objects_of_one_material_tell_more_than_either(tmp_path: Path) -> None:
    """Meshes in millimetres and said to be; one γ, ν, α, β for both, each within four of its spreads, and the spreads
    smaller than one object's. Dimensions are exact: the spreads are those of the lines.
    """
    (tmp_path / "one").mkdir()
    both = fit_case(described(tmp_path, ("bar", "plate"), units="mm", tolerance=0.0))
    one = fit_case(described(tmp_path / "one", ("plate",), units="m", tolerance=0.0))
    assert [(o.line >= 0).sum() for o in both.objects] == [len(o.evidence.lines.freq_hz) for o in both.objects]
    sd, alone = (np.sqrt(np.diag(found.fit.covariance)) for found in (both, one))
    gamma = BRASS.youngs_pa / BRASS.density_kg_m3
    found = np.array(
        [
            np.log(both.fit.alpha_per_s / 6.0),
            np.log(both.fit.beta_s / 3e-8),
            np.log(both.fit.gamma_m2_s2 / gamma),
            both.fit.poisson_ratio - 0.345,
        ]
    )
    which = [0, 1, 2, 4]
    assert (np.abs(found) < 4 * sd[which]).all()
    assert (sd[which] < 0.05).all() and (sd[[0, 2]] < alone[[0, 2]]).all()


def test_one_strike_is_enough_for_a_box(planted: Planted, tmp_path: Path) -> None:
    case = read_case(planted.folder)
    found = fit_case(replace(case, recordings=case.recordings[:1]))
    assert found.fit.verdict == "fitted"
    assert found.fit.gamma_m2_s2 == pytest.approx(BRASS.youngs_pa / BRASS.density_kg_m3, rel=1e-3)
    assert found.fit.alpha_per_s == pytest.approx(6.0, rel=0.05)


def test_impulses_that_contradict_the_sounds_are_told(planted: Planted) -> None:
    """One strike's impulse in mN·s beside another's in N·s: the shapes do not explain a factor of a thousand."""
    case = read_case(planted.folder)
    told = tuple(
        replace(r, impulse_n_s=1e3 * (r.impulse_n_s or 0) if i == 0 else r.impulse_n_s)
        for i, r in enumerate(case.recordings)
    )
    wrong = replace(case, recordings=told)
    (e,) = gather(case)
    assert e.family is not None
    mine = tuple(r for r in told if r.split == "fit")
    found = fit_evidence(
        wrong, (replace(e, recordings=mine, seen=describe_observation(wrong, e.thing, e.guess, mine, e.family)),)
    )
    assert "amplitudes scatter" in found.fit.verdict


def test_only_what_precedes_a_second_hit_is_listened_to(planted: Planted, tmp_path: Path) -> None:
    case = read_case(planted.folder)
    sound, sr = soundfile.read(planted.folder / "s0.wav")
    again = np.concatenate([np.zeros(500), sound, sound])
    soundfile.write(tmp_path / "twice.wav", again, sr, subtype="FLOAT")
    thing = replace(case.objects["box"], mesh=None)
    (e,) = gather(
        replace(
            case,
            onset_s=None,
            objects={"box": thing},
            recordings=(replace(case.recordings[0], file=tmp_path / "twice.wav"),),
        )
    )
    assert e.signals is not None and 0.9 * len(sound) < e.signals.shape[1] <= len(sound) + 20
    assert any("2 hits" in note for note in e.notes)


def _broken_off(planted: Planted, folder: Path, file: str, part: float) -> tuple[CaseRecording, int]:
    """A recording with zeros after a part of it, as an editor leaves it, and how many samples that part has."""
    recording = next(r for r in read_case(planted.folder).recordings if r.file and r.file.name == file)
    sound, sr = soundfile.read(planted.folder / file)
    end = round(part * len(sound))
    soundfile.write(folder / file, np.where(np.arange(len(sound)) < end, sound, 0.0), sr, subtype="FLOAT")
    return replace(recording, file=folder / file), end


def _meshless(planted: Planted, *recordings: CaseRecording) -> RecordedObject:
    case = read_case(planted.folder)
    (e,) = gather(replace(case, objects={"box": replace(case.objects["box"], mesh=None)}, recordings=recordings))
    return e


@pytest.mark.parametrize(("part", "alone"), [(0.2, True), (0.6, False)])
def test_what_breaks_off_ends_there_and_is_named(planted: Planted, tmp_path: Path, part: float, alone: bool) -> None:
    """Zeros are no sound that has died away."""
    cut, end = _broken_off(planted, tmp_path, "s0.wav", part)
    others = () if alone else read_case(planted.folder).recordings[1:2]
    e = _meshless(planted, cut, *others)
    assert e.recordings == (cut, *others)
    assert e.signals is not None and 0.9 * end < e.signals.shape[1] <= end
    assert any("s0.wav breaks off after" in note for note in e.notes)


def test_what_breaks_off_far_sooner_than_the_others_is_named_and_left_out(planted: Planted, tmp_path: Path) -> None:
    cut, _ = _broken_off(planted, tmp_path, "s0.wav", 0.2)
    whole = read_case(planted.folder).recordings[1]
    e, without = _meshless(planted, cut, whole), _meshless(planted, whole)
    assert e.recordings == (whole,)
    assert np.array_equal(np.asarray(e.signals), np.asarray(without.signals))
    assert np.array_equal(e.lines.freq_hz, without.lines.freq_hz)
    assert any("s0.wav breaks off after" in note for note in e.notes)
    assert any("s0.wav goes for" in note and "read without it" in note for note in e.notes)


def test_a_take_cut_to_next_to_nothing_is_named_and_left_out(planted: Planted, tmp_path: Path) -> None:
    case = json.loads((planted.folder / "case.json").read_text())
    _copy(planted, tmp_path)
    _cut(tmp_path, "s0.wav")
    (tmp_path / "case.json").write_text(json.dumps(case))
    found, whole = fit_case(read_case(tmp_path)), read_case(planted.folder)
    (e,) = found.evidence
    assert [r.file.name for r in e.recordings if r.file] == ["s1.wav"]
    assert any("s0.wav goes for" in note and "read without it" in note for note in e.notes)
    alone = fit_case(replace(whole, recordings=whole.recordings[1:]))
    assert found.fit.verdict == alone.fit.verdict == "fitted"
    assert found.fit.gamma_m2_s2 == pytest.approx(alone.fit.gamma_m2_s2, rel=1e-6)


def _copy(planted: Planted, folder: Path) -> None:
    for name in ("box.obj", "s0.wav", "s1.wav", "s2.wav"):
        (folder / name).write_bytes((planted.folder / name).read_bytes())


def _millimetres(case: dict[str, Any], folder: Path) -> None:
    write_box(folder / "box.obj", (140.0, 30.0, 5.0))


def _strike_in_millimetres(case: dict[str, Any], folder: Path) -> None:
    strike = case["recordings"][0]["strike"]
    strike["position"] = [1000 * x for x in strike["position"]]


def _sensor_in_millimetres(case: dict[str, Any], folder: Path) -> None:
    case["sensor"]["position"]["box"] = [1000 * x for x in case["sensor"]["position"]["box"]]


def _unit_twice(case: dict[str, Any], folder: Path) -> None:
    case["objects"]["box"]["units"] = "mm"  # of a mesh that is in metres


def _cut(folder: Path, file: str) -> None:
    content = (folder / file).read_bytes()
    (folder / file).write_bytes(content[: len(content) // 200])


def _all_cut(case: dict[str, Any], folder: Path) -> None:
    for file in ("s0.wav", "s1.wav"):
        _cut(folder, file)


def _header_alone(case: dict[str, Any], folder: Path) -> None:
    (folder / "s0.wav").write_bytes((folder / "s0.wav").read_bytes()[:30])


def _two_rates(case: dict[str, Any], folder: Path) -> None:
    sound, _ = soundfile.read(folder / "s0.wav")
    soundfile.write(folder / "s0.wav", sound, 48_000, subtype="FLOAT")


def _two_materials(case: dict[str, Any], folder: Path) -> None:
    case["objects"]["other"] = {"material": "glass"}
    case["recordings"].append({"features": [{"freq_hz": 500.0}], "object": "other", "split": "fit"})


@parametrize_few(
    ("edit", "error", "word"),
    [
        (_millimetres, MeshError, "143 m across"),
        (_unit_twice, MeshError, "0.000143 m across"),
        (_strike_in_millimetres, MeshError, "strike 1 at .* off the surface"),
        (_sensor_in_millimetres, MeshError, "sensor at .* off the surface"),
        (_all_cut, AudioError, "s[01].wav holds .* ms after the onset"),
        (_header_alone, SonicBulletError, "s0.wav"),
        (_two_rates, AudioError, "rates"),
        (_two_materials, SonicBulletError, "several materials"),
    ],
    (0, 2, 4),
)
def test_what_contradicts_itself_is_one_line(
    planted: Planted, tmp_path: Path, edit: Any, error: type[Exception], word: str
) -> None:
    case = json.loads((planted.folder / "case.json").read_text())
    _copy(planted, tmp_path)
    edit(case, tmp_path)
    (tmp_path / "case.json").write_text(json.dumps(case))
    with pytest.raises(error, match=word) as caught:
        fit_case(read_case(tmp_path))
    assert "\n" not in str(caught.value)
