"""From one log to many takes: what was asked for differs and nothing else, and the same seed gives the same bytes."""

from __future__ import annotations

import json
import re
from pathlib import Path
from typing import Any

import numpy as np
import pytest
import soundfile

from sonic_bullet.files import read_audio, read_log
from sonic_bullet.session.variation import Variation, make_take
from tests.apps.cli.test_commands import error_of, run
from tests.few_cases import parametrize_few
from tests.journeys.test_scene_log_film import SCENE
from tests.made.disks import full_disk

FOOTPRINT = 0.02


@pytest.fixture(scope="module")
def place(tmp_path_factory: pytest.TempPathFactory) -> Path:
    folder = tmp_path_factory.mktemp("takes")
    (folder / "scene.py").write_text(SCENE)
    with pytest.MonkeyPatch.context() as patch:
        patch.chdir(folder)
        assert run("render", "scene.py", "-o", "mix.wav", "--contacts", "log.npz") == 0
    return folder


@pytest.fixture(autouse=True)
def inside(place: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.chdir(place)


def test_the_first_take_is_the_render_of_its_seed_and_all_come_again(capfd: pytest.CaptureFixture[str]) -> None:
    assert run("render", "log.npz", "-o", "own.wav", "--seed", "7") == 0
    words = ("--seed", "7", "--takes", "3", "--page", "takes.html", "--json", "told.json")
    assert run("render", "log.npz", "-o", "take.wav", *words) == 0
    assert "motion, masses and contact forces of every take are those of the log" in capfd.readouterr().err
    first = [Path(f"take-0{k}.wav").read_bytes() for k in (1, 2, 3)]
    page = Path("takes.html").read_bytes()
    assert first[0] == Path("own.wav").read_bytes() and len(set(first)) == 3
    assert run("render", "log.npz", "-o", "take.wav", *words) == 0
    assert [Path(f"take-0{k}.wav").read_bytes() for k in (1, 2, 3)] == first
    assert Path("takes.html").read_bytes() == page
    assert page.count(b"<audio controls") == 3 and not re.search(rb"(?:src|href)=.(?!data:)", page)
    told = json.loads(Path("told.json").read_text())
    assert [one["take"] for one in told["takes"]] == [1, 2, 3] and not told["takes"][0]["drawn"]
    assert {"board", "bar"} == set(told["takes"][1]["drawn"])
    assert run("render", "log.npz", "-o", "third.wav", "--seed", "7", "--take", "3") == 0
    assert Path("third.wav").read_bytes() == first[2]


def parts(log: Any) -> dict[str, Any]:
    """What takes may vary, apart, and what they may not."""
    rows = log.rows.row
    return {
        "surfaces": log.seed,
        "places": np.concatenate([rows["point_a_m"], rows["point_b_m"]]).tobytes(),
        "materials": b"".join(
            b.material.stiffness_pa.tobytes() + repr((b.material.alpha_per_s, b.material.roughness_m)).encode()
            + b.model.freq_hz.tobytes() for b in log.bodies
        ),
        "rest": b"".join(rows[name].tobytes() for name in ("a", "b", "normal", "impulse_n_s", "slip_m_s", "gap_m"))
        + b"".join(step.position_m.tobytes() + step.quaternion_xyzw.tobytes() for step in log.steps)
        + repr([(b.mass_kg, b.name, b.mounting) for b in log.bodies]).encode(),
    }  # fmt: skip


@pytest.mark.parametrize("asked", [("surfaces",), ("places",), ("materials",), ("surfaces", "places", "materials")])
def test_takes_differ_in_what_was_asked_and_nothing_else(asked: tuple[str, ...]) -> None:
    log = read_log("log.npz")
    one, whole = (make_take(log, 2, Variation(frozenset(what))).log for what in (asked, ("surfaces", "places")))
    before, after, other = parts(log), parts(one), parts(whole)
    assert {name for name in before if before[name] != after[name]} == set(asked)
    for name in set(asked) & {"surfaces", "places"}:  # what else varies changes no draw
        assert after[name] == other[name]


@parametrize_few("footprint_m", [None, 0.004, 0.0], 2)
def test_contacts_move_along_surfaces_within_the_footprint(footprint_m: float | None) -> None:
    log = read_log("log.npz")
    varied = make_take(log, 2, Variation(frozenset({"places"}), footprint_m)).log
    radius = [float(np.linalg.norm(body.model.vertex_m, axis=1).max()) for body in log.bodies if body.model]
    most = FOOTPRINT * min(radius) if footprint_m is None else footprint_m
    moved = varied.rows.row["point_a_m"] - log.rows.row["point_a_m"]
    length = np.linalg.norm(moved, axis=1)
    assert length.max() <= most * (1 + 1e-9) and (most == 0 or length.max() > 0.1 * most)
    last: dict[tuple[int, int], int] = {}
    for number, (one, other) in enumerate(zip(log.steps, varied.steps, strict=True)):
        for before, after in zip(one.contacts.row, other.contacts.row, strict=True):
            turn = _matrix(one.quaternion_xyzw[list(one.body).index(before["a"])])
            shift = turn @ (after["point_a_m"] - before["point_a_m"])
            np.testing.assert_allclose(shift @ before["normal"], 0, atol=1e-12)
            last[before["a"], before["b"]] = number
    assert last


def _matrix(quaternion_xyzw: np.ndarray) -> np.ndarray:
    from scipy.spatial.transform import Rotation

    return np.asarray(Rotation.from_quat(quaternion_xyzw).as_matrix())


def test_materials_keep_their_spread_and_their_modes_the_law() -> None:
    """ln of E's factors has the preset's deviation, and every eigenvalue is multiplied by that of E over that of ρ."""
    from sonic_bullet.files import presets
    from sonic_bullet.session.variation import draw_factors

    log = read_log("log.npz")
    steel = presets.load_material("steel")
    draws = [draw_factors(steel, np.random.default_rng(k))["roughness_m"] for k in range(400)]
    assert np.std(np.log(draws)) == pytest.approx(0.8, rel=0.15)
    take = make_take(log, 2, Variation(frozenset({"materials"})))
    for before, after in zip(log.bodies, take.log.bodies, strict=True):
        assert before.model is not None and after.model is not None
        ratio = take.drawn[before.name]["youngs_pa"] / take.drawn[before.name]["density_kg_m3"]
        n = min(before.model.mode_count, after.model.mode_count)
        np.testing.assert_allclose(
            after.model.omega0_squared_per_s2[:n], before.model.omega0_squared_per_s2[:n] * ratio, rtol=1e-9
        )


def test_every_preset_of_tables_draws_factors_within_its_ranges() -> None:
    """A tensor's range is of its largest number."""
    from sonic_bullet.files import presets
    from sonic_bullet.session.variation import draw_factors

    for name in (*presets.table_names(), *presets.made_names()):
        factors = draw_factors(presets.load_material(name), np.random.default_rng(3))
        assert all(np.isfinite(one) and one > 0 for one in factors.values()), name
    spruce = presets.named_preset("spruce").elasticity
    low, high = spruce.range["stiffness_pa"]
    largest = np.max(spruce.stiffness_pa)
    drawn = [draw_factors(presets.load_material("spruce"), np.random.default_rng(k))["stiffness_pa"] for k in range(40)]
    assert low * (1 - 1e-12) <= largest * min(drawn) < largest * max(drawn) <= high * (1 + 1e-12)


def test_roughness_and_gain_set_what_they_name() -> None:
    flat = ("--pascals", "--tail", "0")
    assert run("render", "log.npz", "-o", "mix.wav", "--stems", "stems", *flat) == 0
    assert run("render", "log.npz", "-o", "new.wav", "--gain", "bar=-6", "--contacts", "new.npz", *flat) == 0
    stems = {one.stem.split("-")[1]: soundfile.read(one)[0] for one in Path("stems").glob("*.wav")}
    want = stems["board"] + 10 ** (-6 / 20) * stems["bar"]
    np.testing.assert_allclose(read_audio("new.wav")[0][0], want, atol=2**-21 * np.abs(want).max())
    assert run("render", "new.npz", "-o", "again.wav", *flat) == 0  # the log keeps it
    assert Path("again.wav").read_bytes() == Path("new.wav").read_bytes()
    words = ("--roughness", "board=3.5", "--roughness", "2", "--contacts", "rough.npz")
    assert run("render", "log.npz", "-o", "rough.wav", *words, *flat) == 0
    heights = {body.name: body.material.roughness_m for body in read_log("rough.npz").bodies if body.material}
    assert heights == {"board": pytest.approx(3.5e-6), "bar": pytest.approx(2e-6)}


@pytest.mark.parametrize(
    ("words", "said"),
    [
        (("--gain", "bar=-6", "--gain", "bar=3"), "--gain names bar twice"),
        (("--silent", "bar", "--silent", "bar"), "--silent names bar twice"),
        (("--gain", "cup=-6"), "is called 'cup'"),
        (("--gain", "-6"), "NAME=NUMBER"),
        (("--gain", "bar=loud"), "NAME=NUMBER"),
        (("--roughness", "1", "--roughness", "2"), "twice"),
        (("--roughness", "cup=2"), "is called 'cup'"),
        (("--roughness", "bar=-2"), "from 0"),
        (("--material", "bar=unobtainium"), "unobtainium"),
        (("--takes", "2", "--stems", "x"), "give --take K"),
        (("--takes", "2", "--take", "1"), "give one of both"),
        (("--takes", "2", "--vary", "weather"), "surfaces,places,materials"),
        (("--vary", "places"), "give --takes N too"),
        (("--page", "a.pdf"), ".html"),
        (("--takes", "2", "--page", "a.pdf"), ".html"),
        (("--takes", "0"), "--takes"),
    ],
)
def test_what_cannot_be_is_one_line(words: tuple[str, ...], said: str, capfd: pytest.CaptureFixture[str]) -> None:
    capfd.readouterr()
    assert said in error_of(capfd, "render", "log.npz", "-o", "no.wav", *words)
    assert not list(Path().glob("no*.wav"))


def test_a_full_disk_leaves_the_takes_before(
    capfd: pytest.CaptureFixture[str], monkeypatch: pytest.MonkeyPatch
) -> None:
    from sonic_bullet.apps.cli.scenes import take_outputs

    written = take_outputs.write_at_level

    def third_fails(path: str, *rest: Any, **options: Any) -> Any:
        with full_disk(1000 if "-03" in path else 1 << 30):
            return written(path, *rest, **options)

    monkeypatch.setattr(take_outputs, "write_at_level", third_fails)
    capfd.readouterr()
    words = ("--takes", "4", "--vary", "surfaces", "--tail", "0", "--page", "f.html")
    assert "cannot write" in error_of(capfd, "render", "log.npz", "-o", "full.wav", *words)
    assert sorted(one.name for one in Path().glob("full*.wav")) == ["full-01.wav", "full-02.wav"]
    assert not Path("f.html").exists()
