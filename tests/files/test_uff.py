"""UFF files by pyuff: what is read of them, what is named instead, and what is written."""

from __future__ import annotations

import builtins
import random
from pathlib import Path
from typing import Any

import numpy as np
import pytest
import pyuff

from benchmarks.fuzzing.mutations import changed
from sonic_bullet.files.uff.impulse_response import UFF_BAND_OF_HIGHEST, as_period, measured_band, since_impulse
from sonic_bullet.files.uff.reader import Response, read_uff
from sonic_bullet.files.uff.writer import ModalShapes, write_uff
from sonic_bullet.records import Array
from sonic_bullet.records.errors import FileError, SonicBulletError
from tests.made import responses as made

FREQ_HZ, DECAY, WEIGHT = np.array([410.0, 1130.0, 2215.0]), np.array([6.0, 11.0, 24.0]), np.array([0.8, -0.5, 0.3])
AT_HZ = made.at_lines()
MOBILITY = made.mobility(FREQ_HZ, DECAY, WEIGHT, AT_HZ)
PLACES = {1: (0.05, 0.0, 0.003), 2: (-0.05, 0.01, 0.003)}


def written(path: Path, quantity: str, **more: Any) -> Path:
    value = made.as_quantity(MOBILITY, AT_HZ, quantity)
    one = made.response(value, AT_HZ, ordinate_spec_data_type=made.QUANTITY[quantity])
    return made.write_uff(path, made.nodes(PLACES), one | more)


def as_recording(response: Response) -> tuple[Array, int, tuple[float, float]]:
    """What is heard from the impulse on, its rate, and the band that it holds."""
    sound, sr, measured_hz = as_period(response)
    if not response.spectral:
        return sound, sr, measured_hz
    return since_impulse(sound, sr, measured_hz), sr, measured_band(measured_hz)


@pytest.mark.parametrize("quantity", ["acceleration", "velocity", "displacement", "pressure"])
@pytest.mark.parametrize("binary", [0, 1])
def test_a_response_becomes_the_velocity_after_an_impulse(tmp_path: Path, quantity: str, binary: int) -> None:
    """Against the closed form, each mode taken where its period wraps around, in the band and after the jump."""
    (one,) = read_uff(written(tmp_path / "a.uff", quantity, binary=binary)).responses
    assert (one.quantity, one.per_force, one.spectral) == (quantity, True, True)
    assert one.strike.position_m == PLACES[1] and one.strike.direction == (0, 0, -1)
    assert one.sensor.position_m == PLACES[2] and one.sensor.direction == (0, 0, 1)
    sound, sr, band = as_recording(one)
    assert sr == 2 * AT_HZ[-1] and band == (20.0, pytest.approx(UFF_BAND_OF_HIGHEST * AT_HZ[-1]))
    t = np.arange(len(sound)) / sr
    truth = np.zeros(len(t))
    for f, d, psi in zip(FREQ_HZ, DECAY, WEIGHT, strict=True):
        pole = -d + 2j * np.pi * f
        truth += np.real(psi * (1 + 1j * d / (2 * np.pi * f)) * np.exp(pole * t) / (1 - np.exp(pole * t[-1])))
    assert np.abs(sound - truth)[: sr // 2].max() < 1e-4 * np.abs(truth).max()


def test_units_of_the_file(tmp_path: Path) -> None:
    """Millimetres and newtons, double-precision nodes, and accelerations in g."""
    (plain,) = read_uff(written(tmp_path / "si.uff", "acceleration")).responses
    units = {"type": 164, "units_code": 5, "length": 1000.0, "force": 1.0, "temp": 1.0, "temp_offset": 273.15}
    one = made.response(made.as_quantity(1000 * MOBILITY, AT_HZ, "acceleration"), AT_HZ)
    places = {node: tuple(1000 * x for x in place) for node, place in PLACES.items()}
    (mm,) = read_uff(made.write_uff(tmp_path / "mm.uff", units, made.nodes(places, 2411), one)).responses
    np.testing.assert_allclose(mm.value, plain.value, rtol=1e-9)
    assert mm.strike.position_m == pytest.approx(PLACES[1])
    (g,) = read_uff(written(tmp_path / "g.uff", "acceleration", ordinate_axis_units_lab="g")).responses
    np.testing.assert_allclose(g.value, 9.80665 * plain.value, rtol=1e-9)


def test_what_is_not_understood_is_named(tmp_path: Path) -> None:
    value = made.as_quantity(MOBILITY, AT_HZ, "acceleration")
    ones = [
        made.response(value, AT_HZ),
        made.response(value, AT_HZ, strike=(7, -3), orddenom_spec_data_type=0),
        made.response(np.abs(value), AT_HZ, func_type=6),
        made.response(value, AT_HZ, strike=(1, 5)),
        made.response(value, AT_HZ, orddenom_spec_data_type=12),
    ]
    found = read_uff(made.write_uff(tmp_path / "a.uff", made.nodes(PLACES), *ones))
    assert len(found.responses) == 2
    assert found.notes == (
        "not used: coherences (1), rotations (1), frequency responses of ordinate type 12 per type 12 (1)",
        "no coordinates (dataset 15 or 2411) of node 7, whose place stays null",
        "1 frequency responses do not say per what: taken per force",
    )
    with pytest.raises(FileError, match=r"a\.uff holds no response that is understood \(coherences \(1\)\)"):
        read_uff(made.write_uff(tmp_path / "a.uff", ones[2]))


def test_a_time_record_is_a_recording(tmp_path: Path) -> None:
    rate = 8000
    t = np.arange(rate) / rate
    velocity = np.where(t > 0.05, np.exp(-8 * (t - 0.05)) * np.sin(2 * np.pi * 500 * (t - 0.05)), 0.0)
    one = made.response(velocity, t, func_type=1, ordinate_spec_data_type=11, orddenom_spec_data_type=0)
    (found,) = read_uff(made.write_uff(tmp_path / "a.uff", one)).responses
    sound, sr, _ = as_recording(found)
    assert (sr, found.per_force, found.spectral) == (rate, False, False)
    np.testing.assert_allclose(sound, velocity, atol=1e-9)


def test_rates_that_are_no_whole_number_are_made_one(tmp_path: Path) -> None:
    """6400 lines up to 2500 Hz, 0.390625 Hz apart."""
    at = made.at_lines(6401, 0.390625)
    one = made.response(made.mobility(FREQ_HZ, DECAY, WEIGHT, at), at, ordinate_spec_data_type=11)
    (found,) = read_uff(made.write_uff(tmp_path / "a.uff", one)).responses
    sound, sr, _ = as_recording(found)
    assert abs(len(as_period(found)[0]) * 0.390625 - sr) < 1e-6 and sr >= 5000
    spectrum = np.abs(np.fft.rfft(sound * np.hanning(len(sound))))
    assert np.argmax(spectrum) * sr / len(sound) == pytest.approx(410, abs=0.4)


@pytest.mark.parametrize(
    ("spoil", "said"),
    [
        (lambda b: b"", "is no UFF file"),
        (lambda b: b"RIFF" + bytes(200), "is no UFF file"),
        (lambda b: b[: len(b) // 2], "is cut"),
        (lambda b: b[: len(b) // 2] + b"\n    -1\n", "is cut"),
        (lambda b: b.replace(b"E", b"x").replace(b"e+", b"?+"), "is cut or spoiled"),
        (lambda b: b"    -1\n    58\n    -1\n", "dataset 58, number 1 of the file, is cut or spoiled"),
        (lambda b: b"    -1\n   151\nnothing\n    -1\n", "holds no response that is understood"),
        (lambda b: b"version https://git-lfs.github.com/spec/v1\n", "Git LFS pointer"),
    ],
)
def test_spoiled_files_are_one_line(tmp_path: Path, spoil: Any, said: str) -> None:
    path = written(tmp_path / "a.uff", "velocity")
    path.write_bytes(spoil(path.read_bytes()))
    with pytest.raises(FileError, match=said) as error:
        read_uff(path)
    assert "a.uff" in str(error.value) and "\n" not in str(error.value)


@pytest.mark.parametrize("binary", [0, 1])
def test_mutated_files_end_in_our_own_errors(tmp_path: Path, binary: int) -> None:
    """Bytes changed, cut and doubled, most of them in headers: a file is read, or refused in one short line."""
    at = made.at_lines(200, 10.0)
    one = made.response(made.mobility(FREQ_HZ, DECAY, WEIGHT, at), at, binary=binary, ordinate_spec_data_type=11)
    units = {"type": 164, "units_code": 1, "length": 1.0, "force": 1.0, "temp": 1.0, "temp_offset": 273.15}
    seed = made.write_uff(tmp_path / "seed.uff", units, made.nodes(PLACES), one).read_bytes()
    path, refused = tmp_path / "a.uff", 0
    for number in range(300):
        draw = random.Random(number)
        path.write_bytes(changed(seed[:1800], draw) + seed[1800:] if number % 3 else changed(seed, draw))
        try:
            for response in read_uff(path).responses:
                assert np.isfinite(as_recording(response)[0]).all()
        except SonicBulletError as error:
            assert "\n" not in str(error) and len(str(error)) < 1000
            refused += 1
    assert 50 < refused < 300


def test_missing_file_and_values_that_are_none(tmp_path: Path) -> None:
    with pytest.raises(FileError, match="cannot read"):
        read_uff(tmp_path / "none.uff")
    path = written(tmp_path / "a.uff", "velocity")
    lines = path.read_text().splitlines()
    lines[-2] = "NaN".rjust(20) * 2
    path.write_text("\n".join(lines) + "\n")
    with pytest.raises(FileError, match="NaN"):
        read_uff(path)


def test_without_pyuff_the_extra_is_named(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    path = written(tmp_path / "a.uff", "velocity")
    importing = builtins.__import__

    def refuse(name: str, *rest: Any, **more: Any) -> Any:
        if name == "pyuff":
            raise ImportError("No module named 'pyuff'")
        return importing(name, *rest, **more)

    monkeypatch.setattr(builtins, "__import__", refuse)
    for call in (lambda: read_uff(path), lambda: write_uff(path, shapes())):
        with pytest.raises(FileError, match=r'need pyuff.*; pip install "sonic_bullet\[uff\]"'):
            call()


def shapes(count: int = 5, modes: int = 3) -> ModalShapes:
    rng = np.random.default_rng(4)
    shape = rng.standard_normal((count, 3, modes)).astype(np.float32)
    return ModalShapes(rng.uniform(-1, 1, (count, 3)), shape, FREQ_HZ[:modes], DECAY[:modes], 1.0, "plate, glass — 2")


def test_shapes_are_read_back(tmp_path: Path) -> None:
    one = shapes()
    write_uff(tmp_path / "a.uff", one)
    sets = {kind: [] for kind in (15, 55, 164)}
    for kind, read in zip(*_all(tmp_path / "a.uff"), strict=True):
        sets[kind].append(read)
    (nodes,), modes = sets[15], sets[55]
    np.testing.assert_allclose(np.stack([nodes["x"], nodes["y"], nodes["z"]], axis=1), one.point_m, rtol=5e-6)
    for k, mode in enumerate(modes):
        found = np.stack([mode["r1"], mode["r2"], mode["r3"]], axis=1)
        np.testing.assert_allclose(found, one.shape[:, :, k], rtol=5e-6)  # six figures
        assert mode["freq"] == pytest.approx(FREQ_HZ[k], rel=5e-6)
        zeta = DECAY[k] / np.hypot(DECAY[k], 2 * np.pi * FREQ_HZ[k])
        assert (mode["modal_damp_vis"], mode["modal_m"]) == (pytest.approx(zeta, rel=5e-6), 1.0)
    assert len(modes) == 3 and sets[164][0]["length"] == 1.0


def _all(path: Path) -> tuple[list[int], list[dict[str, Any]]]:
    file = pyuff.UFF(str(path))
    return [int(kind) for kind in file.get_set_types()], file.read_sets()
