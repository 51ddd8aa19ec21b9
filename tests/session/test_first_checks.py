"""What costs nothing to know is said before anything is solved: by `attach`, and by `render` on stderr."""

from __future__ import annotations

import warnings
from pathlib import Path
from typing import Any

import pybullet as p
import pytest

import sonic_bullet as sb
from sonic_bullet.records.errors import DensityWarning, RestitutionWarning, SizeWarning
from sonic_bullet.scene import render_scene
from sonic_bullet.session import unsolved_models
from tests.apps.cli.called_here import call_here


class Solved(Exception):
    pass


@pytest.fixture
def nothing_is_solved(monkeypatch: pytest.MonkeyPatch) -> None:
    def refuse(*_: object, **__: object) -> None:
        raise Solved

    monkeypatch.setattr(unsolved_models, "solved_links", refuse)


def body(client: Any, half_m: tuple[float, ...], mass_kg: float) -> int:
    return int(client.createMultiBody(mass_kg, client.createCollisionShape(p.GEOM_BOX, halfExtents=half_m)))


@pytest.mark.usefixtures("nothing_is_solved")
@pytest.mark.parametrize(
    ("half_m", "mass_kg", "kind", "words"),
    [
        ((120, 10, 5), 0.19, SizeWarning, r"body 0 is 240 m long and would weigh .* globalScaling=0\.001"),
        ((0.12, 0.01, 0.005), 40.0, DensityWarning, r"body 0 weighs 40 kg, a solid of steel 0\.377 kg; set masses"),
        ((4, 4, 0.1), 1e5, SizeWarning, r"ground by its shape and weighs 1e\+05 kg, so it falls.*useFixedBase"),
    ],
)  # fmt: skip
def test_attach_says_it_before_it_solves(
    client: Any, half_m: tuple[float, ...], mass_kg: float, kind: type[Warning], words: str
) -> None:
    listener = sb.attach(client, microphone=(0, -1, 0.5))
    with pytest.warns(kind, match=words) as seen:
        listener.add(body(client, half_m, mass_kg), material="steel")
    assert all(one.filename == __file__ for one in seen)


@pytest.mark.usefixtures("nothing_is_solved")
@pytest.mark.parametrize(("half_m", "mass_kg"), [((0.12, 0.01, 0.005), 0.19), ((4, 4, 0.1), 0.0)])
def test_what_is_as_it_should_be_needs_no_word(client: Any, half_m: tuple[float, ...], mass_kg: float) -> None:
    listener = sb.attach(client, microphone=(0, -1, 0.5))
    with warnings.catch_warnings():
        warnings.simplefilter("error")
        listener.add(body(client, half_m, mass_kg), material="steel")


def bouncing(client: Any) -> None:
    client.setGravity(0, 0, -9.81)
    client.setPhysicsEngineParameter(restitutionVelocityThreshold=0.001)
    for mass_kg in (0.0, 0.1):
        client.changeDynamics(body(client, (0.02, 0.02, 0.02), mass_kg), -1, restitution=0.9)


def test_bounces_that_never_end_are_said_at_the_first_step(client: Any) -> None:
    sb.attach(client, microphone=())
    bouncing(client)
    with pytest.warns(RestitutionWarning, match=r"restitutionVelocityThreshold is 0\.001 m/s.*never comes to rest"):
        client.stepSimulation()
    with warnings.catch_warnings():
        warnings.simplefilter("error")
        client.stepSimulation()


def test_a_plain_script_is_told_it_too(tmp_path: Path) -> None:
    (tmp_path / "a.py").write_text(
        "import pybullet as p\nfrom tests.session.test_first_checks import bouncing\np.connect(p.DIRECT)\nbouncing(p)\n"
        "p.stepSimulation()\n"
    )
    with pytest.warns(RestitutionWarning, match="never comes to rest"):
        render_scene(tmp_path / "a.py", microphones=(), sr=8000)


@pytest.mark.shared
@pytest.mark.usefixtures("nothing_is_solved")
def test_render_says_of_a_scene_in_millimetres_what_doctor_says(shared_path: Path, tmp_path: Path) -> None:
    done = call_here(tmp_path, "render", str(shared_path / "faults" / "11-millimetres" / "scene.py"), "-o", "a.wav")
    notes = [line for line in done.stderr.splitlines() if line.startswith("sonic-bullet: note: ")]
    assert any("body 1 is 240 m long" in line and "globalScaling=0.001" in line for line in notes)
    assert any("body 1 weighs 0.19 kg, a solid of plastic" in line for line in notes)
    assert done.returncode == 0, "nothing was touched, so nothing is solved"
