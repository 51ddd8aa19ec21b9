"""Contact logs and models that are damaged or inconsistent: each is refused by name, and none is unpickled."""

from __future__ import annotations

import io
import zipfile
from collections.abc import Callable
from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest

from sonic_bullet import files
from sonic_bullet.records.errors import LogError
from tests.made.logs import log, model


def forged(folder: Path, **changes: bytes | np.ndarray | None) -> Path:
    """A log with some entries replaced (arrays, raw npy bytes) or left out (None)."""
    files.write_log(folder / "good.npz", log())
    with zipfile.ZipFile(folder / "good.npz") as source, zipfile.ZipFile(folder / "bad.npz", "w") as target:
        entries: dict[str, bytes | np.ndarray | None] = {n[:-4]: source.read(n) for n in source.namelist()}
        for name, value in (entries | changes).items():
            if isinstance(value, np.ndarray):
                stream = io.BytesIO()
                np.save(stream, value)
                target.writestr(f"{name}.npy", stream.getvalue())
            elif value is not None:
                target.writestr(f"{name}.npy", value)
    return folder / "bad.npz"


def npy_claiming(shape: tuple[int, ...], dtype: str = "<f8") -> bytes:
    stream = io.BytesIO()
    np.lib.format.write_array_header_1_0(stream, {"descr": dtype, "fortran_order": False, "shape": shape})
    return stream.getvalue() + bytes(16)


def header_with(folder: Path, old: bytes, new: bytes) -> np.ndarray:
    files.write_log(folder / "good.npz", log())
    with np.load(folder / "good.npz") as good:
        text = good["header"].tobytes()
    assert old in text
    return np.frombuffer(text.replace(old, new), np.uint8)


@pytest.mark.parametrize(
    ("entry", "value", "words"),
    [
        ("step_dt_s", npy_claiming((10**11,)), "claims 800000000000 bytes"),
        ("step_dt_s", npy_claiming((2**62, 2**62)), "claims"),
        ("step_dt_s", npy_claiming((-2,)), "claims"),
        ("step_dt_s", b"not an array", "no array"),
        ("step_dt_s", None, "missing"),
        ("step_dt_s", np.zeros(5, np.float32), "float32"),
        ("step_dt_s", np.full(5, np.nan), "physics step"),
        ("step_dt_s", np.full(5, 1e-300), "dt_s of a physics step is 1e-300"),
        ("step_dt_s", np.zeros((5, 1)), "shape"),
        ("step_dt_s", np.array(["a", "b"]), "plain numbers"),
        ("step_body_count", np.array([2, -1, 4, 4, 4]), "negative"),
        ("step_body_count", np.full(5, 2**39), "shape"),
        ("contact_b", np.full(100, 2, np.int32), "shape"),
        ("body_inertia_kg_m2", np.full((4, 3, 3), np.inf), "NaN or infinite"),
        ("material_stiffness_pa", -np.ones((2, 6, 6)), "stiffness"),
        ("model0_face", np.full((4, 2, 3), 99, np.uint8), "missing vertices"),
        ("header", None, "no header"),
        ("header", np.frombuffer(b"{", np.uint8), "ends too early"),
        ("header", np.frombuffer(b'{"format":"other/3"}', np.uint8), "other/3"),
        ("header", np.frombuffer(b'{"format":"sonic-bullet-contacts/3"}', np.uint8), "field '.*' is missing"),
    ],
)
def test_forged_logs_are_refused_by_name(
    tmp_path: Path, entry: str, value: bytes | np.ndarray | None, words: str
) -> None:
    with pytest.raises(LogError, match=words) as caught:
        files.read_log(forged(tmp_path, **{entry: value}))
    assert "bad.npz" in str(caught.value)


@pytest.mark.parametrize(
    ("old", "new", "words"),
    [
        (b'"model":0', b'"model":9', "refers"),
        (b'"model":0', b'"model":-1', "refers"),
        (b'"sr":44100', b'"sr":"x"', "sr"),
        (b'"sr":44100', b'"sr":0', "sample rate"),
        (b'"microphone"', b'"ear"', "ear"),
        (b'"kind":"quench","step":0', b'"kind":"gong","step":0', "unknown kind 'gong'"),
        (b'"kind":"quench","step":0', b'"kind":"quench","step":4', "order"),
        (b'"kind":"quench","step":0', b'"kind":"quench","step":-1', "before step -1"),
        (b'"step":0,"body":null', b'"step":0,"body":2', "body 2 alone"),
        (b'"kind":"quench","step":0', b'"kind":"quench","step":0.5', "step"),
        (b'"step":2,"body":1,', b'"step":2,"body":4,', "changes of a body that the log has not"),
        (b'"step":2,"body":1,', b'"step":2,"body":-1,', "body of a change"),
        (b'"step":2,"body":1,', b'"step":-2,"body":1,', "step of a change"),
        (b'"step":0,"body":null,"values"', b'"step":9,"body":null,"values"', "changes that are not in the order"),
        (b'"linearDamping":0.04', b'"linearDamping":"thick"', "linearDamping is .thick., wanted a number"),
        (b'"linearDamping":0.04', b'"linearDamping":1e999', "out of range"),
        (b'"fixedTimeStep":0.00', b'"fixedTimeStep":[],"x":0.00', "engine"),
        (b'"pybullet":"3.2.7"', b'"pybullet":3', "versions"),
        (b'"mounting":"free"', b'"mounting":"glued"', "mounting is 'glued'"),
        (b'"count":7', b'"count":0', "count"),
        (b'"fixed":[[0.0,', b'"fixed":[[', "fixed"),
        (b'"residual":false', b'"residual":0', "residual"),
    ],
)
def test_forged_headers_are_refused_by_name(tmp_path: Path, old: bytes, new: bytes, words: str) -> None:
    with pytest.raises(LogError, match=words):
        files.read_log(forged(tmp_path, header=header_with(tmp_path, old, new)))


@pytest.mark.parametrize("value", [1e150, 1e308, np.inf, np.nan])
def test_numbers_beyond_physics_are_refused_where_they_are_read(tmp_path: Path, value: float) -> None:
    with pytest.raises(LogError, match=r"contact point_a_m holds (a number of|NaN or infinite)"):
        files.read_log(forged(tmp_path, contact_point_a_m=np.full((len(log().rows), 3), value)))


def test_a_flag_of_any_byte_is_true(tmp_path: Path) -> None:
    """The engine takes bytes of 0 and 1 alone; a forged log's flag was 33."""
    count = sum(len(step.teleported) for step in log().steps)
    odd = files.read_log(forged(tmp_path, pose_teleported=(33 * (np.arange(count) % 2)).astype(np.uint8).view(bool)))
    seen = np.concatenate([step.teleported for step in odd.steps]).view(np.uint8)
    assert set(seen.tolist()) == {0, 1} and np.array_equal(seen, np.arange(count) % 2)


def test_a_pickle_is_never_opened(tmp_path: Path) -> None:
    stream = io.BytesIO()
    np.save(stream, np.array([{"a": 1}], dtype=object), allow_pickle=True)
    with pytest.raises(LogError, match="plain numbers"):
        files.read_log(forged(tmp_path, step_dt_s=stream.getvalue()))


@pytest.mark.parametrize(
    ("entry", "value"),
    [
        ("model0_shape", np.zeros((3, 4, 3, 3), np.uint8)),
        ("model0_shape", np.zeros((4, 3, 3), np.uint8)),
        ("model0_shape_exponent", np.zeros((2, 3), np.uint8)),
        ("model0_face", np.full((4, 2, 3), 255, np.uint8)),
        ("model0_freq_hz", np.full((8, 3), 255, np.uint8)),
    ],
)
def test_planes_that_are_none_are_refused_by_name(tmp_path: Path, entry: str, value: np.ndarray) -> None:
    with pytest.raises(LogError, match=r"bad\.npz"):
        files.read_log(forged(tmp_path, **{entry: value}))


@pytest.mark.parametrize("index", [-1, 4, 2**31 - 1])
def test_faces_of_vertices_that_are_not_there_are_refused_before_shapes_are_added_up(
    tmp_path: Path, index: int
) -> None:
    made = replace(model(), shape=np.ones((4, 3, 3)))
    files.write_model(tmp_path / "m.npz", made)
    with np.load(tmp_path / "m.npz") as plain:
        entries = dict(plain.items())
    face = np.full((1, 2, 3), index, np.int32).view(np.uint8).reshape(2, 3, 4)
    np.savez(tmp_path / "bad.npz", **(entries | {"model0_face": np.moveaxis(face, -1, 0)}))
    with pytest.raises(LogError, match=r"bad\.npz: faces point at missing vertices"):
        files.read_model(tmp_path / "bad.npz")


@pytest.mark.parametrize("read", [files.read_log, files.read_model])
def test_a_file_that_is_cut_or_damaged_is_one_line(tmp_path: Path, read: Callable[[Path], object]) -> None:
    path = tmp_path / "a.npz"
    if read is files.read_log:
        files.write_log(path, log())
    else:
        files.write_model(path, model())
    whole = path.read_bytes()
    with zipfile.ZipFile(path) as archive:
        largest = max(archive.infolist(), key=lambda info: info.compress_size)
    middle = largest.header_offset + 100 + largest.compress_size // 2
    for broken in (
        whole[:-30],
        whole[: len(whole) // 2],
        whole[:middle] + bytes([whole[middle] ^ 1]) + whole[middle + 1 :],
    ):
        path.write_bytes(broken)
        with pytest.raises(LogError, match=r"a\.npz") as caught:
            read(path)
        assert "\n" not in str(caught.value)


@pytest.mark.parametrize(("factor", "words"), [(0.0, "zero"), (1e-9, "1e-09 long, not 1"), (3.0, "3 long, not 1")])
def test_a_quaternion_that_turns_nothing_is_named_with_step_and_body(tmp_path: Path, factor: float, words: str) -> None:
    """When the log is read, so for every command."""
    files.write_log(tmp_path / "good.npz", log())
    with np.load(tmp_path / "good.npz") as good:
        turn, body, count = (good[f"{x}"] for x in ("pose_quaternion_xyzw", "pose_body", "step_body_count"))
    row = int(count[:2].sum())  # the first of the third step
    turn[row] *= factor
    with pytest.raises(LogError) as caught:
        files.read_log(forged(tmp_path, pose_quaternion_xyzw=turn))
    name = log().bodies[body[row]].name
    assert f"the quaternion of {name!r} in step 2 (the first is 0) is {words}" in str(caught.value)
