"""Contact logs and models on a disk: they come back bit for bit, and what was cut, forged or never one is refused by
name.
"""

from __future__ import annotations

import io
import os
import struct
import zipfile
from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest

from sonic_bullet import files
from sonic_bullet.files.contact_log import ContactLog
from sonic_bullet.records import Air, Body, Material, Microphone, ModalModel, ModalSum, Vibrometer
from sonic_bullet.records.contacts import ROW_FIELDS, Contacts, Event, Step
from sonic_bullet.records.errors import FileError, LogError, ModalError, SonicBulletError


def model(seed: int = 0, modes: int = 3) -> ModalModel:
    rng = np.random.default_rng(seed)
    decay = rng.uniform(1, 9, modes)
    decay[:1] = np.nan
    return ModalModel(
        freq_hz=np.sort(rng.uniform(100, 9000, modes)),
        decay_per_s=decay,
        shape=rng.normal(size=(4, 3, modes)),
        vertex_m=rng.normal(size=(4, 3)),
        face=[[0, 1, 2], [0, 2, 3]],
        curvature_per_m=rng.normal(size=2),
        volume_m3=1e-3 / 3,
        mass_kg=0.1,
        dropped=2,
        note="P2, edge 1 mm \u03b1",
    )


def log(seed: int = 0, steps: int = 5) -> ContactLog:
    rng = np.random.default_rng(seed)
    wood = Material.isotropic(
        "wood", youngs_pa=1.1e10 / 3, poisson=0.3, density_kg_m3=700.1, alpha_per_s=0.1, beta_s=1 / 3e7, source="x"
    )
    bare = Material.isotropic("bare", youngs_pa=1e9, poisson=0.1, density_kg_m3=1.0)
    bodies = (
        Body(0, -1, 0, "plane", 0.0, np.zeros((3, 3)), material=bare),
        Body(1, -1, 0, "cup \ud800 \u00e9", 0.1, np.diag(rng.uniform(size=3)), 1e-4, 3.7, wood, model(1)),
        Body(1, 0, 1, "handle", 0.2, np.eye(3), material=wood, model=model(1), since_step=2, until_step=4),
        Body(7, -1, 1, "other", 0.2, np.eye(3), model=model(2, modes=0)),
    )

    def step(i: int) -> Step:
        b, k = min(2 + i, 4), int(rng.integers(0, 4))
        rows = {name: rng.normal(size=(k, *tail)) for name, (_, tail) in ROW_FIELDS.items()}
        rows["a"], rows["b"] = rng.integers(0, b, k), rng.integers(0, b, k)
        return Step(
            1 / (240 + i),
            rng.normal(size=(b, 3)) / 3,
            rng.normal(size=(b, 4)) / 7,
            rng.random(b) < 0.3,
            Contacts(**rows),
        )

    sensors = (Microphone([0.1, -1 / 3, 1e-300]), Vibrometer(1, [1 / 3, 2 / 3, 0], [1, 2, 3 / 7], 0), ModalSum(1 / 7))
    events = (Event("quench", 0), Event("quench", 3), Event("quench", 3))
    return ContactLog(
        bodies, tuple(step(i) for i in range(steps)), sensors, 44_100, 2**40 + 1, Air(1.19, 340.1 / 3), events=events
    )


def same(x: object, y: object) -> bool:
    """Equal to the last bit, NaN to NaN, through tuples, records and arrays."""
    if isinstance(x, np.ndarray):
        return isinstance(y, np.ndarray) and x.dtype == y.dtype and x.shape == y.shape and x.tobytes() == y.tobytes()
    if isinstance(x, tuple):
        return isinstance(y, tuple) and len(x) == len(y) and all(same(a, b) for a, b in zip(x, y, strict=True))
    if hasattr(x, "__dataclass_fields__"):
        return type(x) is type(y) and all(same(getattr(x, name), getattr(y, name)) for name in x.__dataclass_fields__)
    if isinstance(x, float):
        return isinstance(y, float) and struct.pack("d", x) == struct.pack("d", y)
    if isinstance(x, str):
        return isinstance(y, str) and x.encode("utf-8", "replace") == y.encode("utf-8", "replace")
    return x == y


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
    with pytest.raises(LogError, match="sonic-bullet-contacts/2"):
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
        ("header", np.frombuffer(b'{"format":"sonic-bullet-contacts/1"}', np.uint8), "missing required field"),
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
    from sonic_bullet.modal import cache

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


def test_what_numpy_saves_is_read_too(tmp_path: Path) -> None:
    files.write_model(tmp_path / "m.npz", model())
    with np.load(tmp_path / "m.npz") as plain:
        np.savez(tmp_path / "n.npz", **{name: plain[name] for name in plain.files})
    assert same(model(), files.read_model(tmp_path / "n.npz"))


@pytest.mark.parametrize(
    ("scale", "roll", "refused"),
    [
        ((1, 1, 1), 0, False),
        ((1, 1, 1), -1, True),
        ((0, 0, 0), 0, False),
        ((1, 0, 0), 0, False),
        ((1e-200,) * 3, 0, False),
    ],
)
def test_degenerate_vertices_of_a_model_end_in_sound_or_in_our_own_error(
    tmp_path: Path, scale: tuple[float, float, float], roll: int, refused: bool
) -> None:
    """Triangles that meet themselves have no near field; a surface without area radiates nothing.

    Once, the first ended in ZeroDivisionError.
    """
    from sonic_bullet.render import render_log

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
    if refused:
        with pytest.raises(ModalError, match="surface crosses itself"):
            render_log(read)
    else:
        assert np.isfinite(render_log(read)).all()


@pytest.mark.parametrize("value", [1e150, 1e308, np.inf, np.nan])
def test_numbers_beyond_physics_are_refused_where_they_are_read(tmp_path: Path, value: float) -> None:
    with pytest.raises(LogError, match=r"contact point_a_m holds (a number of|NaN or infinite)"):
        files.read_log(forged(tmp_path, contact_point_a_m=np.full((len(log().rows), 3), value)))


def test_a_log_of_the_first_format_reads_as_one_without_events(tmp_path: Path) -> None:
    """The header names format 1 and has no events."""
    written = replace(log(), events=())
    files.write_log(tmp_path / "new.npz", written)
    with zipfile.ZipFile(tmp_path / "new.npz") as source, zipfile.ZipFile(tmp_path / "old.npz", "w") as target:
        for name in source.namelist():
            content = source.read(name)
            if name == "header.npy":
                with np.load(tmp_path / "new.npz") as entries:
                    text = entries["header"].tobytes()
                old = text.replace(b"sonic-bullet-contacts/2", b"sonic-bullet-contacts/1").replace(b',"events":[]', b"")
                assert old != text and b"events" not in old
                stream = io.BytesIO()
                np.save(stream, np.frombuffer(old, np.uint8))
                content = stream.getvalue()
            target.writestr(name, content)
    assert same(files.read_log(tmp_path / "old.npz"), written)


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
    with zipfile.ZipFile(tmp_path / "small.npz", "w", zipfile.ZIP_DEFLATED) as archive:
        archive.writestr("header.npy", bytes(range(256)))
    with pytest.raises(LogError, match="compressed"):
        files.read_log(tmp_path / "small.npz")


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
