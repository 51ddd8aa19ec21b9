"""Contact logs and models on a disk: they come back bit for bit, and what was cut or never one is refused by name."""

from __future__ import annotations

import copy
import os
import re
from collections.abc import Mapping
from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest
from hypothesis import HealthCheck, assume, given, settings
from hypothesis import strategies as st

from sonic_bullet import files
from sonic_bullet.files.contact_log import ContactLog
from sonic_bullet.files.models import model_key
from sonic_bullet.files.storage.json_text import as_json_text
from sonic_bullet.modal.model_of_size import resize_model
from sonic_bullet.records import Body, Material, Microphone, ModalModel, TouchedSurface
from sonic_bullet.records.contacts import Contacts, Step
from sonic_bullet.records.errors import FileError, LogError, SonicBulletError
from sonic_bullet.records.modal_options import ModalOptions
from sonic_bullet.records.mode_shapes import quantize_shapes
from sonic_bullet.records.simulated import Change
from tests.made.logs import log, model, same

DATA = Path(__file__).parents[1] / "data"


@pytest.mark.parametrize("steps", [0, 1, 5])
def test_a_log_comes_back_bit_for_bit(tmp_path: Path, steps: int) -> None:
    written = log(steps=steps)
    written.save(tmp_path / "a.npz")
    read = files.read_log(tmp_path / "a.npz")
    assert same(written, read)
    assert [p.name for p in tmp_path.iterdir()] == ["a.npz"]
    files.write_log(tmp_path / "b.npz", read)
    assert (tmp_path / "a.npz").read_bytes() == (tmp_path / "b.npz").read_bytes()


def test_an_empty_log_comes_back(tmp_path: Path) -> None:
    written = ContactLog((), (), (), 48_000, 0)
    files.write_log(tmp_path / "a.npz", written)
    assert same(written, files.read_log(tmp_path / "a.npz"))


def test_equal_models_and_materials_are_stored_once(tmp_path: Path) -> None:
    files.write_log(tmp_path / "a.npz", log())
    with np.load(tmp_path / "a.npz", allow_pickle=False) as plain:
        assert {n for n in plain.files if n.endswith("_freq_hz")} == {"model0_freq_hz", "model1_freq_hz"}
        assert plain["material_stiffness_pa"].shape == (2, 6, 6)
    read = files.read_log(tmp_path / "a.npz")
    assert read.bodies[1].model is read.bodies[2].model


def test_a_model_comes_back_bit_for_bit(tmp_path: Path) -> None:
    files.write_model(tmp_path / "m.npz", model())
    assert same(model(), files.read_model(tmp_path / "m.npz"))
    shell = replace(model(), assumed_wall_m=0.0024)
    files.write_model(tmp_path / "shell.npz", shell)
    assert same(shell, files.read_model(tmp_path / "shell.npz")) and model_key(shell) != model_key(model())
    for name, holds in (("m.npz", False), ("shell.npz", True)):  # as files of before the field, where there is none
        with np.load(tmp_path / name) as arrays:
            assert any(b"assumed_wall_m" in array.tobytes() for array in arrays.values()) == holds
    with pytest.raises(LogError, match="sonic-bullet-contacts/3"):
        files.read_log(tmp_path / "m.npz")


def test_every_cut_of_a_log_is_one_named_error(tmp_path: Path) -> None:
    files.write_log(tmp_path / "a.npz", log())
    whole = (tmp_path / "a.npz").read_bytes()
    cuts = list(range(0, len(whole), max(1, len(whole) // 60)))
    for cut in cuts:
        (tmp_path / "cut.npz").write_bytes(whole[:cut])
        with pytest.raises(LogError, match=r"cut\.npz") as caught:
            files.read_log(tmp_path / "cut.npz")
        assert "\n" not in str(caught.value)
    assert len(cuts) >= 60


def test_no_flipped_byte_passes_or_crashes(tmp_path: Path) -> None:
    written = log()
    files.write_log(tmp_path / "a.npz", written)
    whole = bytearray((tmp_path / "a.npz").read_bytes())
    rng, refused = np.random.default_rng(0), 0
    for position in rng.integers(0, len(whole), 300):
        broken = bytearray(whole)
        broken[position] ^= 1 << int(rng.integers(8))
        (tmp_path / "b.npz").write_bytes(broken)
        try:
            assert same(files.read_log(tmp_path / "b.npz"), written)  # a flip in zip metadata that nothing depends on
        except SonicBulletError as error:
            assert "b.npz" in str(error)
            refused += 1
    assert refused > 200


def test_what_numpy_saves_is_read_too(tmp_path: Path) -> None:
    files.write_model(tmp_path / "m.npz", model())
    with np.load(tmp_path / "m.npz") as plain:
        np.savez(tmp_path / "n.npz", **{name: plain[name] for name in plain.files})
    assert same(model(), files.read_model(tmp_path / "n.npz"))


@pytest.mark.parametrize(
    ("scale", "roll"),
    [((1, 1, 1), 0), ((1, 1, 1), -1), ((0, 0, 0), 0), ((1, 0, 0), 0), ((1e-200,) * 3, 0)],
)
def test_degenerate_vertices_of_a_model_end_in_sound(
    tmp_path: Path, scale: tuple[float, float, float], roll: int
) -> None:
    """Triangles that meet themselves have no near field, and the compact law stands for it; a surface without area
    radiates nothing.
    """
    from sonic_bullet.engine.runtime.replay import render_log

    corner = np.array([[x, y, z] for x in (-1, 1) for y in (-1, 1) for z in (-1, 1)]) * 0.05
    quads = [(0, 1, 3, 2), (4, 6, 7, 5), (0, 4, 5, 1), (2, 3, 7, 6), (0, 2, 6, 4), (1, 5, 7, 3)]
    face = np.array([t for q in quads for t in ((q[0], q[1], q[2]), (q[0], q[2], q[3]))])
    shape = np.random.default_rng(0).normal(size=(8, 3, 1))
    made = ModalModel(
        np.array([900.0]), np.array([5.0]), shape, np.roll(corner * scale, roll, axis=0), face, np.zeros(12), 1e-3, 1.0
    )
    wood = Material.isotropic("wood", youngs_pa=1e9, poisson=0.3, density_kg_m3=1e3, alpha_per_s=1.0, beta_s=1e-7)
    body = Body(0, -1, 0, "box", 1.0, np.eye(3), 1e-3, material=wood, model=made)
    step = Step(1 / 240, np.zeros((1, 3)), np.array([[0, 0, 0, 1.0]]), np.zeros(1, bool), Contacts.none())
    files.write_log(tmp_path / "a.npz", ContactLog((body,), (step,), (Microphone(np.array([0.0, -1, 0.5])),), 8000, 0))
    read = files.read_log(tmp_path / "a.npz")
    assert np.isfinite(render_log(read)).all()


def test_the_surface_that_is_touched_comes_back(tmp_path: Path) -> None:
    own = model()
    surface = TouchedSurface(own.vertex_m * 1.1, own.face[:1], np.array([7.0]))
    for one in (own, replace(own, touched=surface)):
        files.write_model(tmp_path / "model.npz", one)
        read = files.read_model(tmp_path / "model.npz")
        assert model_key(read) == model_key(one) and (read.touched is None) == (one.touched is None)
    assert read.touched is not None and all(
        getattr(read.touched, name).tobytes() == getattr(surface, name).tobytes()
        for name in ("vertex_m", "face", "curvature_per_m")
    )
    half = resize_model(read, 0.5, lambda value: 0 * value).touched
    assert half is not None and (half.vertex_m == surface.vertex_m / 2).all()
    assert (half.curvature_per_m == surface.curvature_per_m * 2).all()


def test_what_is_set_otherwise_holds_from_its_step_on() -> None:
    written = log()
    assert written.settings(0) == {"fixedTimeStep": 1 / 240, "erp": 0.2}
    assert written.settings(2) == {"fixedTimeStep": 1 / 240, "numSolverIterations": 10.0}
    assert "linearDamping" not in written.dynamics(1, 1) and written.dynamics(1, 1)["restitution"] == 1 / 3
    assert written.dynamics(1, 2) == {**written.bodies[1].dynamics, "restitution": 0.25, "linearDamping": 0.04}
    assert len(written.first(1).changes) == 1 and len(written.first(2).changes) == 3
    with pytest.raises(LogError, match="index is 4"):
        written.dynamics(4)
    with pytest.raises(LogError, match="step is -1"):
        written.settings(-1)


NAMES = st.text(st.characters(exclude_categories=()), max_size=8)
NUMBERS = st.floats(-1e30, 1e30)


@settings(max_examples=60, deadline=None, suppress_health_check=[HealthCheck.function_scoped_fixture])
@given(
    dynamics=st.dictionaries(NAMES, NUMBERS, max_size=5),
    engine=st.dictionaries(NAMES, NUMBERS, max_size=5),
    lost=st.dictionaries(NAMES, st.none() | NUMBERS, max_size=5),
    fixed=st.lists(st.tuples(NUMBERS, NUMBERS, NUMBERS, st.floats(0, 1)), max_size=3),
    wall=st.none() | st.floats(1e-6, 1.0),
    count=st.none() | st.integers(1, 2000),
    name=NAMES,
)
def test_whatever_is_known_comes_back(
    tmp_path: Path,
    dynamics: dict[str, float],
    engine: dict[str, float],
    lost: dict[str, float | None],
    fixed: list[tuple[float, ...]],
    wall: float | None,
    count: int | None,
    name: str,
) -> None:
    """Lone surrogates, which JSON cannot hold, become question marks; two names may become one then."""
    assume(all(len({as_json_text(key) for key in values}) == len(values) for values in (dynamics, engine, lost)))
    asked = ModalOptions(count=count, fixed=fixed, thickness_m=wall)
    body = Body(3, -1, 0, name, 1.0, np.eye(3), dynamics=dynamics, options=asked)
    written = ContactLog((body,), (), (), 48_000, 0, engine=engine, changes=(Change(0, 0, lost),))
    files.write_log(tmp_path / "a.npz", written)
    read = files.read_log(tmp_path / "a.npz")

    def as_kept(values: Mapping[str, float | None]) -> dict[str, float | None]:
        return {as_json_text(key): x for key, x in values.items()}

    assert read.bodies[0].dynamics == as_kept(dynamics) and read.engine == as_kept(engine)
    assert read.changes[0].values == as_kept(lost)
    assert same(read.bodies[0].options, asked) and read.bodies[0].name == as_json_text(name)
    files.write_log(tmp_path / "b.npz", read)
    assert same(files.read_log(tmp_path / "b.npz"), read)


@pytest.mark.parametrize(("number", "words"), [(b"2", "no longer read; make it anew"), (b"4", "wanted")])
def test_logs_and_models_of_other_formats_are_one_line(tmp_path: Path, number: bytes, words: str) -> None:
    files.write_log(tmp_path / "contacts.npz", log())
    files.write_model(tmp_path / "model.npz", model())
    for name, read in (("contacts", files.read_log), ("model", files.read_model)):
        with np.load(tmp_path / f"{name}.npz") as plain:
            entries = dict(plain.items())
        form = re.compile(rb"(sonic-bullet-\w+)/[0-9]")
        number = b"1" if (name, number) == ("model", b"2") else number
        text = form.sub(rb"\1/" + number, entries["header"].tobytes())
        np.savez(tmp_path / f"{name}.npz", **(entries | {"header": np.frombuffer(text, np.uint8)}))
        with pytest.raises(LogError, match=words):
            read(tmp_path / f"{name}.npz")


@pytest.mark.parametrize("content", [b"", b"PK\x05\x06" + bytes(18), b"hello", bytes(1000)])
def test_foreign_files_are_no_logs(tmp_path: Path, content: bytes) -> None:
    (tmp_path / "a.npz").write_bytes(content)
    with pytest.raises(LogError, match=r"a\.npz"):
        files.read_log(tmp_path / "a.npz")


def test_missing_files_folders_and_pipes(tmp_path: Path) -> None:
    os.mkfifo(tmp_path / "pipe.npz")
    for path in (tmp_path, tmp_path / "none.npz", tmp_path / "pipe.npz"):
        with pytest.raises(FileError, match="cannot read"):
            files.read_log(path)
    with pytest.raises(FileError, match="mkdir -p"):
        files.write_log(tmp_path / "none" / "a.npz", log())


def rounded_model(seed: int = 0) -> ModalModel:
    made = model(seed)
    return replace(made, shape=quantize_shapes(made.shape))


def test_shapes_that_were_rounded_are_whole_numbers_in_a_file_and_come_back_bit_for_bit(tmp_path: Path) -> None:
    files.write_model(tmp_path / "m.npz", rounded_model())
    assert same(rounded_model(), files.read_model(tmp_path / "m.npz"))
    with np.load(tmp_path / "m.npz") as plain:
        assert plain["model0_shape"].shape == (2, 4, 3, 3) and plain["model0_shape"].dtype == np.uint8
    files.write_model(tmp_path / "exact.npz", model())
    with np.load(tmp_path / "exact.npz") as plain:
        assert plain["model0_shape"].shape == (4, 4, 3, 3) and "model0_shape_exponent" not in plain.files


def test_a_model_of_nothing_but_zeros_is_written_so_that_it_is_read(tmp_path: Path) -> None:
    """It would deflate to less than a reader takes for honest."""
    made = replace(
        model(), shape=np.zeros((40_000, 3, 3)), vertex_m=np.zeros((40_000, 3)), face=np.zeros((2, 3), np.int32)
    )
    files.write_model(tmp_path / "m.npz", made)
    assert same(made, files.read_model(tmp_path / "m.npz"))


@pytest.fixture
def own_cache(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> Path:
    monkeypatch.setenv("SONIC_BULLET_CACHE", str(tmp_path / "cache"))
    return tmp_path / "cache"


def test_a_log_by_reference_comes_back_bit_for_bit_and_holds_no_model(tmp_path: Path, own_cache: Path) -> None:
    written = log()
    written.save(tmp_path / "a.npz", models="reference")
    assert same(written, files.read_log(tmp_path / "a.npz"))
    with np.load(tmp_path / "a.npz") as plain:
        assert not [name for name in plain.files if name.startswith("model")]
    whole = (tmp_path / "a.npz").read_bytes()
    assert len(list(own_cache.iterdir())) == 2  # of three bodies, two of which share one
    files.read_log(tmp_path / "a.npz").save(tmp_path / "b.npz", models="reference")
    assert (tmp_path / "b.npz").read_bytes() == whole


@pytest.mark.parametrize("harm", ["gone", "cut", "another", "folder"])
def test_a_model_that_the_cache_has_not_is_one_line_naming_bodies_folder_and_remedy(
    tmp_path: Path, own_cache: Path, harm: str
) -> None:
    log().save(tmp_path / "a.npz", models="reference")
    kept = sorted(own_cache.iterdir())
    for path in kept if harm == "folder" else kept[:1]:
        whole = path.read_bytes()
        path.unlink()
        if harm == "cut":
            path.write_bytes(whole[:-100])
        if harm == "another":
            path.write_bytes(kept[1].read_bytes())
    with pytest.raises(LogError, match=r"a\.npz leaves the modes of .*to the cache") as caught:
        files.read_log(tmp_path / "a.npz")
    assert str(own_cache) in str(caught.value) and "SONIC_BULLET_CACHE" in str(caught.value)
    assert "\n" not in str(caught.value) and ("other" in str(caught.value)) + ("handle" in str(caught.value)) >= 1
    log().save(tmp_path / "a.npz", models="reference")  # a harmed entry is replaced
    assert same(log(), files.read_log(tmp_path / "a.npz"))


def test_without_a_cache_a_log_by_reference_is_refused_and_nothing_is_written(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.delenv("SONIC_BULLET_CACHE", raising=False)
    (tmp_path / "no").touch()  # no folder can be made below a file
    monkeypatch.setenv("XDG_CACHE_HOME", str(tmp_path / "no" / "home"))
    with pytest.raises(FileError, match="no cache that models could be left to; set SONIC_BULLET_CACHE"):
        log().save(tmp_path / "a.npz", models="reference")
    with pytest.raises(FileError, match="models is 'references'; did you mean reference"):
        log().save(tmp_path / "a.npz", models="references")
    assert list(tmp_path.iterdir()) == [tmp_path / "no"]


def test_a_cache_too_small_for_the_models_of_a_log_is_said_and_no_log_is_written(
    tmp_path: Path, own_cache: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setenv("SONIC_BULLET_CACHE_LIMIT", "1kB")
    with pytest.raises(FileError, match=r"too small for the models.*raise SONIC_BULLET_CACHE_LIMIT"):
        log().save(tmp_path / "a.npz", models="reference")
    assert not (tmp_path / "a.npz").exists()


def test_a_log_is_copied_by_value(tmp_path: Path) -> None:
    files.write_log(tmp_path / "a.npz", log())
    for one in (log(), files.read_log(tmp_path / "a.npz")):
        assert same(copy.deepcopy(one), one)
        with pytest.raises(TypeError, match="read-only"):
            one.engine["erp"] = 1.0  # type: ignore[index]
