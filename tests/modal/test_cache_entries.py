"""A cache entry is what was kept or nothing: flipped, forged, cut, of another name or form, it is a miss, computed
anew and replaced.
"""

from __future__ import annotations

import io
import json
import zipfile
from collections.abc import Callable
from pathlib import Path

import numpy as np
import pytest
import trimesh

from sonic_bullet.files import cache
from sonic_bullet.modal import analyse, eigen, reduced, tensor
from sonic_bullet.radiation import radiated
from sonic_bullet.records import Air, Material, ModalModel, Shape

STEEL = Material.isotropic("steel", youngs_pa=2e11, poisson=0.29, density_kg_m3=7850, alpha_per_s=4.0, beta_s=2e-9)
LAYOUT = {"x": cache.Kept("f8", ("n", 3)), "i": cache.Kept("i", ("m",), "n"), "b": cache.Kept("b1", (1,))}
ARRAYS = {"x": np.arange(12.0).reshape(4, 3), "i": np.array([0, 3]), "b": np.array([True])}


def skin() -> Shape:
    """A box that is solved by elements, as it is once their size is given."""
    box = trimesh.creation.box((0.1, 0.08, 0.05))
    return Shape("mesh", vertex_m=box.vertices, face=box.faces)


def model() -> ModalModel:
    box = trimesh.creation.box((0.1, 0.08, 0.05))
    shape = np.random.default_rng(0).normal(size=(8, 3, 2))
    return ModalModel(
        np.array([900.0, 2100.0]), np.array([5.0, 9.0]), shape, box.vertices, box.faces, np.zeros(12), 4e-4, 3.14
    )


def of_modes(folder: Path) -> list[np.ndarray]:
    made = analyse((skin(),), STEEL, count=2, edge_m=0.03, cache=folder)
    return [made.freq_hz, made.shape, made.vertex_m, made.face, made.curvature_per_m]


def of_family(folder: Path) -> list[np.ndarray]:
    made = reduced.family(skin(), gamma_m2_s2=2.5e7, poisson=0.3, to_hz=16_000, edge_m=0.03, cache=folder)
    return [made.lame, made.shear, made.skin, made.vertex_m, made.face]


def of_tensor(folder: Path) -> list[np.ndarray]:
    made = tensor.tensor_family(skin(), poisson=0.3, count=2, edge_m=0.03, cache=folder)
    return [made.part, made.body.skin, made.body.vertex_m]


def of_radiation(folder: Path) -> list[np.ndarray]:
    return list(radiated.radiation_and_note.__wrapped__(model(), Air(), folder)[:2])


def entries(path: Path) -> dict[str, bytes]:
    with zipfile.ZipFile(path) as archive:
        return {name: archive.read(name) for name in archive.namelist()}


def rewritten(path: Path, parts: dict[str, bytes]) -> None:
    with zipfile.ZipFile(path, "w", zipfile.ZIP_STORED) as archive:
        for name, content in parts.items():
            archive.writestr(zipfile.ZipInfo(name), content)


def npy(array: np.ndarray) -> bytes:
    stream = io.BytesIO()
    np.save(stream, array)
    return stream.getvalue()


@pytest.mark.parametrize("make", [of_modes, of_family, of_tensor, of_radiation])
def test_float32_in_place_of_float64_is_a_miss_and_is_replaced(
    tmp_path: Path, make: Callable[[Path], list[np.ndarray]], monkeypatch: pytest.MonkeyPatch
) -> None:
    fresh = make(tmp_path)
    kept = {path: path.read_bytes() for path in tmp_path.glob("*.npz")}
    for path in kept:
        parts = entries(path)
        wide = {
            name: npy(array.astype(np.float32))
            for name, content in parts.items()
            if (array := np.load(io.BytesIO(content))).dtype == np.float64
        }
        assert wide
        rewritten(path, parts | wide)
    again = make(tmp_path)
    assert all(one.tobytes() == other.tobytes() for one, other in zip(fresh, again, strict=True))
    assert {path: path.read_bytes() for path in tmp_path.glob("*.npz")} == kept
    for room, name in (
        (eigen, "solve"),
        (reduced, "chosen"),
        (tensor, "_of_elements"),
        (radiated.radiation, "radiation"),
    ):
        monkeypatch.setattr(room, name, lambda *_, **__: pytest.fail("computed again"))
    assert all(one.tobytes() == other.tobytes() for one, other in zip(fresh, make(tmp_path), strict=True))


def saved(folder: Path) -> Path:
    cache.save(folder, "k", ARRAYS, "note")
    assert cache.load(folder, "k", LAYOUT) is not None
    return folder / "k.npz"


def test_flipped_bits_are_a_miss_or_change_nothing(tmp_path: Path) -> None:
    path = saved(tmp_path)
    whole = path.read_bytes()
    missed = 0
    positions = range(0, len(whole), 7)
    for position in positions:
        path.write_bytes(whole[:position] + bytes([whole[position] ^ 1 << position % 8]) + whole[position + 1 :])
        found = cache.load(tmp_path, "k", LAYOUT)
        missed += found is None
        assert found is None or (
            found[1] == "note" and all(found[0][name].tobytes() == ARRAYS[name].tobytes() for name in ARRAYS)
        )
    assert missed > 0.8 * len(positions)


@pytest.mark.parametrize(
    "other",
    [
        {"x": ARRAYS["x"].astype(np.float32)},
        {"x": ARRAYS["x"].astype(">f8")},
        {"x": np.where(ARRAYS["x"] == 5, np.nan, ARRAYS["x"])},
        {"x": np.where(ARRAYS["x"] == 5, np.inf, ARRAYS["x"])},
        {"x": ARRAYS["x"].ravel()},
        {"x": ARRAYS["x"][:3]},
        {"i": np.array([0, 4])},
        {"i": np.array([-1, 0])},
        {"i": np.array([0.0, 3.0])},
        {"b": np.array([True, True])},
        {"more": np.zeros(1)},
        {"b": None},
    ],
)
def test_an_entry_of_another_form_is_a_miss_though_its_digest_is_right(
    tmp_path: Path, other: dict[str, np.ndarray | None]
) -> None:
    made = {name: array for name, array in (ARRAYS | other).items() if array is not None}
    cache.save(tmp_path, "k", made, "note")  # type: ignore[arg-type]
    assert cache.load(tmp_path, "k", LAYOUT) is None


def test_an_entry_under_another_name_and_one_of_the_old_form_are_misses(tmp_path: Path) -> None:
    path = saved(tmp_path)
    (tmp_path / "other.npz").write_bytes(path.read_bytes())
    assert cache.load(tmp_path, "other", LAYOUT) is None
    parts = entries(path)
    old = npy(np.frombuffer(json.dumps({"format": "sonic-bullet-cache/1", "note": "note"}).encode(), np.uint8))
    rewritten(path, parts | {"header.npy": old})
    assert cache.load(tmp_path, "k", LAYOUT) is None
