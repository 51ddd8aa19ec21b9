"""Contact logs that somebody made by hand: each is refused by name, and none is unpacked or unpickled before."""

from __future__ import annotations

import io
import re
import struct
import tracemalloc
import zipfile
import zlib
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
        ("step_dt_s", np.zeros((5, 1)), "shape"),
        ("step_dt_s", np.array(["a", "b"]), "plain numbers"),
        ("step_body_count", np.array([2, -1, 4, 4, 4]), "negative"),
        ("step_body_count", np.full(5, 2**39), "shape"),
        ("contact_b", np.full(100, 2, np.int32), "shape"),
        ("body_inertia_kg_m2", np.full((4, 3, 3), np.inf), "NaN or infinite"),
        ("material_stiffness_pa", -np.ones((2, 6, 6)), "stiffness"),
        ("model0_face", np.full((2, 3), 99, np.int32), "missing vertices"),
        ("header", None, "no header"),
        ("header", np.frombuffer(b"{", np.uint8), "no contact log"),
        ("header", np.frombuffer(b'{"format":"other/3"}', np.uint8), "other/3"),
        ("header", np.frombuffer(b'{"format":"sonic-bullet-contacts/1"}', np.uint8), "field '.*' is missing"),
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


@pytest.mark.parametrize(
    "text",
    [
        b"{'descr': '<f8', 'fortran_order': False, 'shape': (5,",
        b"{'descr': '<f8', 'fortran_order': False, 'shape': (((((5,), }",
        b"{" * 900,
        b"'''",
        b"{'descr': '<f8', 'fortran_order': False, 'shape': (99999999999999999999999999, 0), }",
        b"{'descr': '<f8', 'fortran_order': False, 'shape': (0, 9223372036854775807), }",
        b"{'descr': '<f99', 'fortran_order': False, 'shape': (5,), }",
    ],
)
def test_an_npy_header_that_is_none_is_one_line_for_logs_and_models_and_a_miss_for_caches(
    tmp_path: Path, text: bytes
) -> None:
    from sonic_bullet.files import cache

    raw = b"\x93NUMPY\x01\x00" + struct.pack("<H", len(text) + 1) + text + b"\n" + bytes(40)
    files.write_model(tmp_path / "m.npz", model())
    cache.save(tmp_path, "c", {"x": np.zeros(5)}, "")
    for name in ("m", "c"):
        with zipfile.ZipFile(tmp_path / f"{name}.npz") as archive:
            parts = {n: archive.read(n) for n in archive.namelist()}
        with zipfile.ZipFile(tmp_path / f"{name}.npz", "w") as archive:
            for n, content in parts.items():
                archive.writestr(n, content if n == "header.npy" else raw)
    assert cache.load(tmp_path, "c", {"x": cache.Kept("f8", (5,))}) is None
    for path, read in ((forged(tmp_path, step_dt_s=raw), files.read_log), (tmp_path / "m.npz", files.read_model)):
        with pytest.raises(LogError, match=path.name) as caught:
            read(path)
        assert "\n" not in str(caught.value)


def without_one(whole: bytes, lost: str) -> bytes:
    """The same file, its directory silent about one entry and consistent in itself."""
    end = whole.rindex(b"PK\x05\x06")
    count, size, start = struct.unpack("<HII", whole[end + 10 : end + 20])
    at = start
    while True:
        name, extra, note = struct.unpack("<HHH", whole[at + 28 : at + 34])
        stop = at + 46 + name + extra + note
        if whole[at + 46 : at + 46 + name] == lost.encode():
            break
        at = stop
    tail = (
        whole[end : end + 8] + struct.pack("<HHII", count - 1, count - 1, size - (stop - at), start) + whole[end + 20 :]
    )
    return whole[:at] + whole[stop:end] + tail


def test_an_entry_that_the_directory_hides_is_refused(tmp_path: Path) -> None:
    """Arrays that only some models have (bend, choke) could vanish without a word."""
    bent = replace(model(), bend_s2_m2=np.ones(3), damping_growth_s_m=np.ones(3))
    files.write_model(tmp_path / "m.npz", bent)
    whole = (tmp_path / "m.npz").read_bytes()
    for name in ("model0_bend_s2_m2.npy", "model0_choke_s_m.npy", "model0_freq_hz.npy", "header.npy"):
        (tmp_path / "m.npz").write_bytes(without_one(whole, name))
        assert name not in zipfile.ZipFile(tmp_path / "m.npz").namelist()
        with pytest.raises(LogError, match="directory"):
            files.read_model(tmp_path / "m.npz")


@pytest.mark.parametrize(
    ("before", "after"), [(b"x", b""), (b"", b"x"), (bytes(22), b""), (b"", bytes(22)), (b"", b"PK\x05\x06")]
)
def test_bytes_around_a_log_are_refused(tmp_path: Path, before: bytes, after: bytes) -> None:
    files.write_log(tmp_path / "a.npz", log())
    (tmp_path / "a.npz").write_bytes(before + (tmp_path / "a.npz").read_bytes() + after)
    with pytest.raises(LogError, match=r"a\.npz"):
        files.read_log(tmp_path / "a.npz")


def test_a_name_twice_and_a_header_that_contradicts_the_directory_are_refused(tmp_path: Path) -> None:
    files.write_model(tmp_path / "m.npz", model())
    whole = (tmp_path / "m.npz").read_bytes()
    with zipfile.ZipFile(tmp_path / "m.npz", "a") as archive, pytest.warns(UserWarning, match="Duplicate"):
        archive.writestr("model0_freq_hz.npy", npy_claiming((2,)))
    with pytest.raises(LogError, match="twice"):
        files.read_model(tmp_path / "m.npz")
    at = whole.index(b"PK\x03\x04", 1)
    for offset in (6, 14, 18, 22):  # flags, CRC, packed size, size
        (tmp_path / "m.npz").write_bytes(
            whole[: at + offset] + bytes([whole[at + offset] ^ 1]) + whole[at + offset + 1 :]
        )
        with pytest.raises(LogError, match=r"m\.npz"):
            files.read_model(tmp_path / "m.npz")


@pytest.mark.parametrize("value", [1e150, 1e308, np.inf, np.nan])
def test_numbers_beyond_physics_are_refused_where_they_are_read(tmp_path: Path, value: float) -> None:
    with pytest.raises(LogError, match=r"contact point_a_m holds (a number of|NaN or infinite)"):
        files.read_log(forged(tmp_path, contact_point_a_m=np.full((len(log().rows), 3), value)))


def test_a_pickle_is_never_opened(tmp_path: Path) -> None:
    stream = io.BytesIO()
    np.save(stream, np.array([{"a": 1}], dtype=object), allow_pickle=True)
    with pytest.raises(LogError, match="plain numbers"):
        files.read_log(forged(tmp_path, step_dt_s=stream.getvalue()))


def test_zip_bombs_are_refused_before_they_grow(tmp_path: Path) -> None:
    with zipfile.ZipFile(tmp_path / "bomb.npz", "w", zipfile.ZIP_DEFLATED) as archive:
        archive.writestr("header.npy", npy_claiming((10**8,)) + bytes(10**8))
    assert (tmp_path / "bomb.npz").stat().st_size < 2e5
    with pytest.raises(LogError, match="claims more bytes"):
        files.read_log(tmp_path / "bomb.npz")
    for name in ("model0_shape.npy", "step_dt_s.npy"):
        with zipfile.ZipFile(tmp_path / "bomb.npz", "w", zipfile.ZIP_DEFLATED) as archive:
            archive.writestr(name, npy_claiming((10**8,)) + bytes(10**8))
        with pytest.raises(LogError, match="claims more bytes"):
            files.read_log(tmp_path / "bomb.npz")
    with zipfile.ZipFile(tmp_path / "small.npz", "w", zipfile.ZIP_DEFLATED) as archive:
        archive.writestr("header.npy", bytes(range(256)))
    with pytest.raises(LogError, match="compressed"):
        files.read_log(tmp_path / "small.npz")


def deflated(folder: Path, content: bytes, claimed: int, crc: int | None = None, after: bytes = b"") -> Path:
    """A model whose shape is a deflate stream of ``content`` that claims another size; consistent in all else."""
    files.write_model(folder / "m.npz", model())
    with zipfile.ZipFile(folder / "m.npz") as source:
        entries = {name: source.read(name) for name in source.namelist()}
    entries.pop("model0_shape.npy")
    with zipfile.ZipFile(folder / "m.npz", "w") as archive:
        for name, raw in entries.items():
            archive.writestr(name, raw)
    stream = zlib.compressobj(6, zlib.DEFLATED, -15)
    raw = stream.compress(content) + stream.flush() + after
    name, whole = b"model0_shape.npy", (folder / "m.npz").read_bytes()
    end = whole.rindex(b"PK\x05\x06")
    count, size, start = struct.unpack("<HII", whole[end + 10 : end + 20])
    said = (8, 0, 0x21, zlib.crc32(content) if crc is None else crc, len(raw), claimed, len(name), 0)
    local = struct.pack("<4s5H3I2H", b"PK\x03\x04", 20, 0, *said) + name + raw
    entry = struct.pack("<4s6H3I5H2I", b"PK\x01\x02", 20, 20, 0, *said, 0, 0, 0, 0, start) + name
    tail = struct.pack("<4s4H2IH", b"PK\x05\x06", 0, 0, count + 1, count + 1, size + len(entry), start + len(local), 0)
    (folder / "m.npz").write_bytes(whole[:start] + local + whole[start : start + size] + entry + tail)
    return folder / "m.npz"


def planes() -> bytes:
    with io.BytesIO() as stream:
        np.save(stream, np.moveaxis(model().shape[..., None].view(np.uint8), -1, 0).copy())
        return stream.getvalue()


def test_a_deflated_entry_that_is_as_it_claims_is_read(tmp_path: Path) -> None:
    content = planes()
    read = files.read_model(deflated(tmp_path, content, len(content)))
    assert read.shape.tobytes() == model().shape.tobytes()


@pytest.mark.parametrize("change", ["longer", "shorter", "bomb", "checksum", "hidden", "half", "no stream"])
def test_a_deflated_entry_that_lies_is_one_line_and_takes_no_memory(tmp_path: Path, change: str) -> None:
    content, claimed, crc, after = planes(), len(planes()), None, b""
    if change == "longer":
        claimed += 100
    elif change == "shorter":
        claimed -= 100
    elif change == "bomb":
        content += bytes(10**9)
    elif change == "checksum":
        crc = 1
    elif change == "hidden":
        after = b"more"
    path = deflated(tmp_path, content, claimed, crc, after)
    del content
    if change in ("half", "no stream"):
        whole, at = path.read_bytes(), path.read_bytes().index(b"model0_shape.npy") + 16
        broken = b"\x00" * 40 if change == "half" else b"\xff" * 40
        path.write_bytes(whole[:at] + broken + whole[at + 40 :])
    tracemalloc.start()
    with pytest.raises(LogError, match=r"m\.npz") as caught:
        files.read_model(path)
    peak = tracemalloc.get_traced_memory()[1]
    tracemalloc.stop()
    assert "\n" not in str(caught.value) and peak < 4 * path.stat().st_size + 1e5


def test_a_claim_to_unpack_to_more_than_64_times_the_file_is_refused_before_it_is(tmp_path: Path) -> None:
    path = deflated(tmp_path, planes() + bytes(10**6), len(planes()) + 10**6)
    with pytest.raises(LogError, match="claims more bytes than it has"):
        files.read_model(path)


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


@pytest.mark.parametrize("name", ["../../etc/passwd", "a" * 63, "g" * 64, "a" * 64 + "\\n", ""])
def test_a_reference_that_is_no_digest_is_refused(tmp_path: Path, name: str, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setenv("SONIC_BULLET_CACHE", str(tmp_path / "cache"))
    log().save(tmp_path / "a.npz", models="reference")
    with np.load(tmp_path / "a.npz") as plain:
        text, entries = plain["header"].tobytes(), dict(plain.items())
    forged_text = re.sub(rb'"models":\["[0-9a-f]{64}"', b'"models":["' + name.encode() + b'"', text)
    assert forged_text != text
    np.savez(tmp_path / "bad.npz", **(entries | {"header": np.frombuffer(forged_text, np.uint8)}))
    with pytest.raises(LogError, match=r"bad\.npz is no contact log"):
        files.read_log(tmp_path / "bad.npz")
