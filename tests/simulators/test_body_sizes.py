"""A body larger than anything that is struck to sound is told of every time: a mesh in millimetres, a ground, a
terrain. Others are not.
"""

from __future__ import annotations

import sys
import warnings
from functools import cache
from pathlib import Path
from typing import Any
from xml.etree import ElementTree

import numpy as np
import pybullet as p
import pybullet_data
import pytest
from pybullet_utils.bullet_client import BulletClient

import sonic_bullet as sb
from sonic_bullet.apps.cli import main
from sonic_bullet.files import meshes
from sonic_bullet.geometry import HEAVIEST_STRUCK_KG, LARGEST_M, oversize, volume_m3
from sonic_bullet.records.errors import MeshError, SizeWarning
from sonic_bullet.simulators import diagnose_world
from sonic_bullet.simulators.pybullet.urdf_meshes import join_surfaces

DATA = Path(pybullet_data.getDataPath())
GROUNDS = {"plane.urdf", "plane100.urdf", "plane_transparent.urdf", "samurai.urdf"}
"""Models that come with PyBullet, and are grounds or terrains: blocks of 30 to 200 m, and the yard of a monastery, 177
m across.
"""
UNREADABLE = {"kuka_iiwa/model_for_sdf.urdf", "toys/concave_box.urdf", "torus_deform.urdf", "random_urdfs/168/168.urdf"}
"""Models that PyBullet itself does not load, and one all of whose vertices are NaN."""
BAR = "v 0 0 0\nv 120 0 0\nv 120 20 0\nv 0 20 0\nv 0 0 6\nv 120 0 6\nv 120 20 6\nv 0 20 6\n"
SIDES = "f 4 3 2 1\nf 5 6 7 8\nf 1 2 6 5\nf 2 3 7 6\nf 3 4 8 7\nf 4 1 5 8\n"


@pytest.fixture
def bar(tmp_path: Path) -> Path:
    """A bar of 120 × 20 × 6 mm, in millimetres."""
    (tmp_path / "bar.obj").write_text(BAR + SIDES)
    return tmp_path / "bar.obj"


def command(monkeypatch: pytest.MonkeyPatch, *words: str) -> int:
    monkeypatch.setattr(sys, "argv", ["sonic-bullet", *words])
    with warnings.catch_warnings(), pytest.raises(SystemExit) as done:
        main()
    return int(done.value.code or 0)


def test_modes_tells_of_a_mesh_in_millimetres_every_time(
    bar: Path, monkeypatch: pytest.MonkeyPatch, capfd: pytest.CaptureFixture[str]
) -> None:
    for _ in range(2):
        assert command(monkeypatch, "modes", str(bar), "--count", "1", "--json") == 0
        said = capfd.readouterr()
        assert "warning" in said.err and "120 m long" in said.err and "--scale 0.001" in said.err
        assert '"modes"' in said.out
    assert command(monkeypatch, "modes", str(bar), "--count", "1", "--scale", "0.001") == 0
    assert "long" not in capfd.readouterr().err


def test_fit_refuses_a_mesh_in_millimetres_with_the_remedy(bar: Path, tmp_path: Path) -> None:
    from sonic_bullet.files.cases import Case, CaseObject, CaseRecording, Line
    from sonic_bullet.lab.fit.material_fit import fit_case

    thing = CaseObject("bar", bar, 1.0, "steel")
    lines = (Line(1000.0, 5.0), Line(2700.0, 8.0))
    case = Case("bar", tmp_path, {"bar": thing}, (CaseRecording(None, lines, "bar", "fit"),))
    with pytest.raises(MeshError, match=r"122 m across; .*--scale 0\.001"):
        fit_case(case)


def test_listener_doctor_and_render_tell_of_a_block_of_400_000_cubic_metres(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch, capfd: pytest.CaptureFixture[str]
) -> None:
    client: Any = BulletClient(p.DIRECT)
    try:
        client.setAdditionalSearchPath(str(DATA))
        plane, cube = client.loadURDF("plane.urdf"), client.loadURDF("cube_small.urdf", [0, 0, 1])
        listener = sb.attach(client, sr=8000, microphone=())
        for _ in range(2):
            with pytest.warns(SizeWarning, match=r"body 0.*200 m long.*globalScaling=0\.001"):
                listener.add(plane, material="concrete", count=1)
        with warnings.catch_warnings():
            warnings.simplefilter("error")
            listener.add(cube, material="wood", count=1)
        told = [f for f in diagnose_world(listener.world) if f.id == "scale"]
        assert [("body 0" in f.what, "200 m" in f.what) for f in told] == [(True, True)]
        listener.detach()
    finally:
        client.disconnect()
    scene = (
        "SECONDS = 0.02\ndef build(c):\n    c.setAdditionalSearchPath(r'%s')\n    b = c.loadURDF('plane.urdf')\n"
        "    return {b: {'material': 'steel', 'count': 1}}\n"
    )
    (tmp_path / "s.py").write_text(scene % DATA)
    for _ in range(2):
        assert (
            command(
                monkeypatch,
                "render",
                str(tmp_path / "s.py"),
                "-o",
                str(tmp_path / "a.wav"),
                "--contacts",
                str(tmp_path / "a.npz"),
            )
            == 0
        )
        assert "note: plane (body 0)" in capfd.readouterr().err
    assert command(monkeypatch, "render", str(tmp_path / "a.npz"), "-o", str(tmp_path / "b.wav")) == 0
    assert "200 m long" in capfd.readouterr().err
    assert command(monkeypatch, "doctor", str(tmp_path / "s.py"), "--seconds", "0.01") == 0
    assert "warning: scale: plane (body 0)" in capfd.readouterr().out


@cache
def _surface(path: Path) -> tuple[np.ndarray, np.ndarray]:
    return join_surfaces(meshes.read_surfaces(path))


def _file(name: str, folder: Path) -> Path:
    name = name.rsplit("package://", maxsplit=1)[-1]
    places = [
        folder / name,
        DATA / name,
        *(parent / name for parent in folder.parents if DATA in (parent, *parent.parents)),
    ]
    return next(place for place in places if place.is_file())


def _piece(geometry: ElementTree.Element, folder: Path) -> tuple[np.ndarray, float]:
    """Edges (3,) of a collision piece's bounding box in m, and its volume in m³, as the URDF states them."""
    kind = geometry[0]
    if kind.tag == "mesh":
        vertex, face = _surface(_file(kind.attrib["filename"], folder))
        scale = np.array([float(x) for x in kind.get("scale", "1 1 1").split()[:3]])
        return np.ptp(vertex * scale, axis=0), abs(volume_m3(vertex * scale, face))
    if kind.tag == "box":
        edge = np.array([float(x) for x in kind.attrib["size"].split()])
        return edge, float(np.prod(edge))
    if kind.tag == "plane":
        return np.zeros(3), 0.0
    radius, length = float(kind.attrib["radius"]), float(kind.get("length", 0))
    ball = 4 / 3 * np.pi * radius**3 if kind.tag in ("sphere", "capsule") else 0.0
    return 2 * radius * np.ones(3) + [0, 0, length], ball + np.pi * radius**2 * length


@pytest.mark.slow
def test_of_the_models_that_come_with_pybullet_grounds_alone_are_told_of() -> None:
    """All URDF files of it, each link at the size that it states, as if of steel."""
    told, links, files = set(), 0, sorted(DATA.rglob("*.urdf"))
    for path in files:
        if str(path.relative_to(DATA)) in UNREADABLE:
            continue
        for link in ElementTree.fromstring(path.read_text().strip("\0 \n")).iter("link"):
            pieces = [_piece(geometry, path.parent) for geometry in link.iterfind("collision/geometry")]
            edge = max((edge for edge, _ in pieces), key=np.max, default=np.zeros(3))
            links += 1
            if oversize(np.array([np.zeros(3), edge]), 7850 * sum(volume for _, volume in pieces)):
                told.add(str(path.relative_to(DATA)))
    assert told == GROUNDS
    assert len(files) >= 1000 and links > 1700


def test_the_limits_are_the_largest_bells() -> None:
    bell = np.array([[-3.3, -3.3, 0], [3.3, 3.3, 6.14]])
    assert oversize(bell, 201_924) == ""
    assert oversize(bell * 10, 201_924) and oversize(bell, 4e5)
    assert (LARGEST_M, HEAVIEST_STRUCK_KG) == (10.0, 202e3)
    ball_mm = 4.2  # the smallest steel ball that is told of when its millimetres are taken for metres
    assert oversize(np.array([[0, 0, 0], [ball_mm] * 3]), 7850 * np.pi / 6 * ball_mm**3)
