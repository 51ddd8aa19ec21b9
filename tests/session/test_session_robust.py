"""What users do wrong, and what worlds do under way: one clear line, or sound that goes on."""

from __future__ import annotations

from pathlib import Path
from typing import Any

import numpy as np
import pybullet as p
import pytest

import sonic_bullet as sb
from sonic_bullet.machine.progress import progress_to, report_progress
from sonic_bullet.records.errors import (
    AudioError,
    FileError,
    LogError,
    MaterialError,
    RecordError,
    SceneError,
    SonicBulletError,
)
from sonic_bullet.simulators import disconnect
from tests.made.models import STEEL
from tests.made.worlds import box, floor, plate_model, sounding_box


def steps(client: Any, count: int) -> None:
    for _ in range(count):
        client.stepSimulation()


def one_line(error: pytest.ExceptionInfo[SonicBulletError]) -> None:
    assert "\n" not in str(error.value)
    assert error.value.remedy


# --- refused, with one line


@pytest.mark.parametrize("sr", [0, -48_000, 10**9, float("nan"), float("inf"), 44_100.5, "fast"])
def test_sample_rates_that_cannot_be(client: Any, sr: Any) -> None:
    with pytest.raises(AudioError) as error:
        sb.attach(client, sr=sr)
    one_line(error)


@pytest.mark.parametrize(
    "place", [(0, float("nan"), 0), (0, 0), [(0, 0, 0), (0, float("inf"), 1)], "here", None, [(0, 0, 1), (2,)]]
)
def test_microphones_that_are_no_points(client: Any, place: Any) -> None:
    with pytest.raises(RecordError) as error:
        sb.attach(client, microphone=place)
    one_line(error)


@pytest.mark.parametrize("what", [None, object(), 99, "client"])
def test_clients_that_are_none(what: Any) -> None:
    with pytest.raises(SceneError) as error:
        sb.attach(what)
    one_line(error)


def test_materials_that_are_unknown_or_never_stop_ringing(client: Any) -> None:
    body = box(client, (0, 0, 1))
    listener = sb.attach(client)
    with pytest.raises(MaterialError, match="unobtainium") as error:
        listener.add(body, material="unobtainium", model=plate_model())
    one_line(error)
    with pytest.raises(MaterialError, match="no damping") as error:
        listener.add(
            body,
            material=sb.Material.isotropic("ideal", youngs_pa=1e9, poisson=0.3, density_kg_m3=1000),
            model=plate_model(),
        )
    one_line(error)


@pytest.mark.parametrize("mass", [float("nan"), -1.0, 1e300])
def test_masses_that_are_none(client: Any, mass: float) -> None:
    body = box(client, (0, 0, 1))
    client.changeDynamics(body, -1, mass=mass)
    listener = sb.attach(client)
    known = client.getDynamicsInfo(body, -1)[0]
    if known == mass or not np.isfinite(known):
        with pytest.raises(SonicBulletError, match=str(body)) as error:
            listener.add(body, material=STEEL, model=plate_model())
            steps(client, 3)
        one_line(error)


def test_bodies_that_are_gone_or_never_were(client: Any) -> None:
    body = box(client, (0, 0, 1))
    listener = sb.attach(client)
    client.removeBody(body)
    for who in (body, 77):
        with pytest.raises(SceneError, match=str(who)) as error:
            listener.add(who, material=STEEL, model=plate_model())
        one_line(error)
    with pytest.raises(SceneError) as error:
        listener.add(box(client, (0, 0, 1)), 3, material=STEEL, model=plate_model())
    one_line(error)
    with pytest.raises(LogError) as error:
        listener.contacts.impulse_on(77)
    one_line(error)


def test_a_lost_connection_is_named_and_the_sound_so_far_stays(tmp_path: Path) -> None:
    raw = p.connect(p.DIRECT)
    from pybullet_utils.bullet_client import BulletClient

    client = BulletClient(p.DIRECT)
    client.setGravity(0, 0, -9.81)
    floor(client)
    listener = sb.attach(client)
    sounding_box(client, listener, (0, 0, 0.1))
    steps(client, 60)
    p.disconnect(client._client)
    p.disconnect(raw)
    with pytest.raises(SceneError) as error:
        client.stepSimulation()
    disconnect(client)  # or its finaliser ends whoever has its id next
    one_line(error)
    listener.write(tmp_path / "so_far.wav")
    assert np.abs(sb.read_audio(str(tmp_path / "so_far.wav"))[0]).max() > 0.01
    listener.detach()


def test_a_path_that_cannot_be_written(client: Any, tmp_path: Path) -> None:
    listener = sb.attach(client)
    steps(client, 3)
    with pytest.raises(FileError) as error:
        listener.write(tmp_path / "no" / "folder" / "a.wav")
    one_line(error)
    with pytest.raises(FileError) as error:
        listener.contacts.save(tmp_path / "no" / "folder" / "a.npz")
    one_line(error)
    assert not list(tmp_path.iterdir())


@pytest.mark.parametrize("seed", ["x", -1, 1.5, None])
def test_seeds_that_are_none(client: Any, seed: Any) -> None:
    with pytest.raises(RecordError) as error:
        sb.attach(client, seed=seed)
    one_line(error)


def test_adding_tells_which_body_is_analysed_and_an_unknown_body_before_any_work(
    client: Any, monkeypatch: pytest.MonkeyPatch
) -> None:
    from sonic_bullet import modal

    def analyse(shapes: Any, material: Any, **_: Any) -> Any:
        report_progress("assembling")
        return plate_model()

    monkeypatch.setattr(modal, "analyse", analyse)
    monkeypatch.setattr(modal, "missing_name", lambda *_: None)  # nothing is solved side by side beforehand
    body = box(client, (0, 0, 1))
    listener = sb.attach(client)
    told: list[str] = []
    listener.add(body, material=STEEL, progress=told.append)
    name = listener.world.name_of(body)
    assert not told
    listener.solve_all()
    assert told == [f"modes of {name}: assembling", f"how 4 modes of {name} radiate"]
    assert f"body {body}" in told[0]
    monkeypatch.setattr(modal, "analyse", lambda *_, **__: pytest.fail("analysed for nobody"))
    with pytest.raises(SceneError, match="no body 99"):
        listener.add(99, material=STEEL, mesh=listener.world.shapes_of(body))


def test_a_script_with_its_own_listener_that_breaks_keeps_what_was_heard(tmp_path: Path) -> None:
    from sonic_bullet.scene import render_scene

    scene = tmp_path / "own.py"
    scene.write_text(
        "import pybullet as p, sonic_bullet as sb\n"
        "from pybullet_utils.bullet_client import BulletClient\n"
        "client = BulletClient(p.DIRECT)\n"
        "listener = sb.attach(client)\n"
        "for _ in range(24):\n"
        "    client.stepSimulation()\n"
        "raise ValueError('x')\n"
    )
    shares: list[float] = []
    with pytest.raises(SceneError, match="line 7: ValueError: x") as error, progress_to(fraction=shares.append):
        render_scene(scene, seconds=1)
    assert error.value.partial.samples.shape == (1, 4800)  # type: ignore[attr-defined]
    assert shares[-1] == pytest.approx(0.1)


@pytest.mark.parametrize(
    "cast", ['{0: {"material": "steel", "nonsense": 3}}', "{0: 3.0}", '{"x": "steel"}', '{(0, 1, 2): "steel"}']
)
def test_casts_that_make_no_sense_are_one_line(tmp_path: Path, cast: str) -> None:
    from sonic_bullet.scene import render_scene

    scene = tmp_path / "cast.py"
    scene.write_text(
        "def build(client):\n"
        "    client.createMultiBody(1, client.createCollisionShape(client.GEOM_SPHERE, radius=0.01))\n"
        f"    return {cast}\n"
    )
    with pytest.raises(SonicBulletError) as error:
        render_scene(scene, seconds=0.1)
    one_line(error)


def test_a_body_that_has_touched_nothing_has_no_impulses(client: Any) -> None:
    body = box(client, (0, 0, 5))
    listener = sb.attach(client)
    steps(client, 3)
    assert listener.contacts.impulse_on(body).shape == (0, 3)
    assert listener.contacts.rows_on(body).shape == (0,)
    with pytest.raises(LogError, match="no body 7"):
        listener.contacts.impulse_on(7)
