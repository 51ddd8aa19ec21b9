"""Two scenes: what was changed is found and named, and put back it makes the one of the other, to the bit."""

from __future__ import annotations

from pathlib import Path

import numpy as np
import pybullet
import pytest

import sonic_bullet
from sonic_bullet.apps.compare import SceneSide, compare
from sonic_bullet.apps.compare.compared_sides import compare_sides
from sonic_bullet.apps.compare.sides import Side, run
from sonic_bullet.records.errors import CompareError, SceneError
from sonic_bullet.simulators import own_clients
from tests.apps.compare.made import scene
from tests.few_cases import parametrize_few

DENSE = (
    '"material": steel,',
    '"material": dataclasses.replace(steel, density_kg_m3=steel.density_kg_m3 * 1.01),',
)
CHANGES = {
    "density": (DENSE, "bar", "material density_kg_m3"),
    "mass": (("        0.004,", "        0.0044,"), "ball", "mass"),
    "restitution": (("ball, -1, restitution=0.9", "ball, -1, restitution=0.85"), "ball", "restitution"),
    "start": (("[0, 0, 0.025]", "[0, 0.001, 0.025]"), "ball", "start position"),
    "velocity": (("[0.1, 0, -1.0]", "[0.1, 0, -1.1]"), "ball", "start velocity"),
    "gravity": (("client.setGravity(0, 0, 0)", "client.setGravity(0, 0, -1)"), "", "gravity"),
    "time step": (("1 / 240", "1 / 480"), "", "time step"),
    "microphone": (("-0.4, 0.3", "-0.42, 0.3"), "", "microphones"),
    "shape": (("radius=0.005)", "radius=0.0055)"), "ball", "shape radius"),
    "material": (
        ('{"material": "steel", "name": "ball"}', '{"material": "glass", "name": "ball"}'),
        "ball",
        "material",
    ),
    "mounting": (('"name": "bar"}', '"name": "bar", "mounting": "placed"}'), "bar", "mounting"),
    "a call that is gone": (("    client.resetBaseVelocity(ball, [0.1, 0, -1.0])\n", ""), "ball", "start velocity"),
    "length": (("SECONDS = 0.12", "SECONDS = 0.14"), "", "seconds"),
}
DECOY = ("far, -1, restitution=0.5", "far, -1, restitution=0.2")


@pytest.fixture(scope="module")
def folder(tmp_path_factory: pytest.TempPathFactory) -> Path:
    return tmp_path_factory.mktemp("compared")


@pytest.fixture(scope="module")
def first(folder: Path) -> Side:
    return run(SceneSide(scene(folder, "a.py")), "a")


@parametrize_few("name", CHANGES, (0, 1, 7, 10, 11))
def test_the_cause_is_what_was_changed(folder: Path, first: Side, name: str) -> None:
    change, who, what = CHANGES[name]
    found = compare_sides(first, run(SceneSide(scene(folder, "b.py", change)), "b"))
    assert not found.same
    assert [(one.who, one.what) for one in found.causes] == [(who, what)]
    assert found.exact
    assert found.verdict.endswith("put back, the scene is A to the bit")


def test_a_shape_is_put_back_beside_a_client_that_somebody_left(folder: Path) -> None:
    with own_clients():
        pybullet.connect(pybullet.DIRECT)
        found = compare(scene(folder, "a.py"), scene(folder, "b.py", CHANGES["shape"][0]))
    assert [one.what for one in found.causes] == ["shape radius"]
    assert found.exact


def test_two_changes_are_both_named_and_a_decoy_is_not(folder: Path, first: Side) -> None:
    changes = [CHANGES[name][0] for name in ("density", "microphone")]
    found = compare_sides(first, run(SceneSide(scene(folder, "b.py", *changes, DECOY)), "b"))
    assert {one.what for one in found.causes} == {"material density_kg_m3", "microphones"}
    assert found.differences[-1].what == "restitution"
    assert found.differences[-1].cause is False
    shares = [one.share for one in found.causes]
    assert all(share is not None for share in shares)
    assert sum(x for x in shares if x is not None) == pytest.approx(1, abs=1e-9)  # Shapley values are efficient


def test_an_input_that_changes_no_sample_is_said_and_the_two_are_the_same(folder: Path, first: Side) -> None:
    found = compare_sides(first, run(SceneSide(scene(folder, "b.py", DECOY)), "b"))
    assert found.same
    assert found.passed
    assert [(one.what, one.cause) for one in found.differences] == [("restitution", False)]


def test_a_body_that_is_missing_is_one_input_and_comes_back(folder: Path) -> None:
    ball = "    ball = client.createMultiBody("
    second = "    other = client.createMultiBody(0.01, client.createCollisionShape(client.GEOM_SPHERE, radius=0.006),"
    second += " basePosition=[0.03, 0, 0.03])\n    client.resetBaseVelocity(other, [0, 0, -1])\n"
    cast = ('"name": "ball"}', '"name": "ball"}, other: {"material": "steel", "name": "other"}')
    a = scene(folder, "two.py", (ball, second + ball), cast)
    found = compare(a, scene(folder, "one.py"))
    assert [(one.who, one.what) for one in found.causes] == [("other", "body")]
    assert found.exact
    back = compare(scene(folder, "one.py"), a)
    assert [(one.who, one.what) for one in back.causes] == [("other", "body")]
    assert back.exact


def test_unchanged_scenes_are_the_same_bits(folder: Path, first: Side) -> None:
    again = run(SceneSide(scene(folder, "b.py")), "b")
    found = compare_sides(first, again)
    assert found.same
    assert found.differences == found.effects == ()
    assert np.array_equal(first.sound.samples(), again.sound.samples())


def test_how_it_is_rendered_is_an_input(folder: Path, first: Side) -> None:
    for options, what in (({"sr": 44_100}, "sr"), ({"seed": 3}, "seed")):
        side = run(SceneSide(scene(folder, "b.py"), **options), "b")
        found = compare_sides(first, side)
        assert [one.what for one in found.differences] == [what]
        assert found.same or found.exact


@pytest.mark.slow
def test_a_plain_script_is_compared_too(folder: Path) -> None:
    text = (
        "import pybullet as p\np.connect(p.DIRECT)\np.setGravity(0, 0, -9.81)\n"
        "board = p.createCollisionShape(p.GEOM_BOX, halfExtents=[.2, .2, .01])\n"
        "p.createMultiBody(0, board, basePosition=[0, 0, -.01])\n"
        "p.createMultiBody(0.03, p.createCollisionShape(p.GEOM_SPHERE, radius=0.02), basePosition=[0, 0, 0.03])\n"
        "for _ in range(40):\n    p.stepSimulation()\n"
    )
    (folder / "s.py").write_text(text)
    (folder / "t.py").write_text(text.replace("0.03,", "0.04,", 1))
    found = compare(folder / "s.py", folder / "t.py")
    assert [one.what for one in found.causes] == ["mass"]
    assert found.exact


def test_what_acts_under_way_is_put_back(folder: Path) -> None:
    act = "\n\ndef act(client, time_s):\n    if 0.0 <= time_s:\n        client.applyExternalForce(1, -1, [0, FORCE, 0]"
    act += ", [0, 0, 0], client.LINK_FRAME)\n"
    text = scene(folder, "x.py").read_text()
    for name, force in (("m.py", "0.1"), ("n.py", "0.2")):
        (folder / name).write_text(text + act.replace("FORCE", force))
    found = compare(folder / "m.py", folder / "n.py")
    assert [one.what for one in found.causes] == ["force"]  # from the first step on, and one input
    assert found.exact


def test_another_order_of_making_is_one_input(folder: Path) -> None:
    text = scene(folder, "x.py").read_text()
    start, middle, end = (text.index(x) for x in ("    bar = ", "    ball = ", "    for body in"))
    (folder / "turned.py").write_text(text[:start] + text[middle:end] + text[start:middle] + text[end:])
    found = compare(scene(folder, "a.py"), folder / "turned.py")
    assert [one.what for one in found.differences] == ["turn"]
    assert found.same or found.exact


def test_a_script_that_makes_one_more_is_put_back(folder: Path) -> None:
    text = scene(folder, "x.py").read_text()
    script = text.replace("def build(client):", "import pybullet as client\n\nclient.connect(client.DIRECT)\nif True:")
    more = "    more = client.createMultiBody(\n        0.004, "
    more += "client.createCollisionShape(client.GEOM_SPHERE, radius=0.005), basePosition=[0.03, 0, 0.02]\n    )\n"
    more += "    client.resetBaseVelocity(more, [0, 0, -1.0])\n"
    for name, one in (("one.py", ""), ("two.py", more)):
        end = '    ears = sb.attach(client, microphone=MICROPHONE)\n    ears.add(bar, material="steel")\n'
        end += '    ears.add(ball, material="steel")\n' + ('    ears.add(more, material="steel")\n' if one else "")
        end += "    for step in range(28):\n        client.stepSimulation()\n        ears.step()\n"
        (folder / name).write_text(script[: script.index("    steel = ")] + one + end)
    found = compare(folder / "one.py", folder / "two.py")
    assert not found.same
    assert [one.what for one in found.causes] == ["body"], found.lines()
    assert found.exact


def test_the_scene_that_breaks_is_named(folder: Path) -> None:
    broken = scene(folder, "broken.py", ("SECONDS = 0.12", "SECONDS = 0.12\n\n\ndef act(client, time_s):\n    1 / 0\n"))
    with pytest.raises(SceneError, match=r"broken.py.*ZeroDivisionError"):
        compare(scene(folder, "a.py"), broken)


def test_another_scene_altogether_is_refused(folder: Path) -> None:
    other = scene(folder, "other.py", ('"name": "bar"', '"name": "gong"'), ('"name": "ball"', '"name": "cup"'))
    with pytest.raises(CompareError, match="no body"):
        compare(scene(folder, "a.py"), other)


def test_stopped_it_has_what_it_had(folder: Path, first: Side, monkeypatch: pytest.MonkeyPatch) -> None:
    from sonic_bullet.apps.compare import compared_sides as comparing

    def stop(*_: object, **__: object) -> None:
        raise KeyboardInterrupt

    side = run(SceneSide(scene(folder, "b.py", CHANGES["mass"][0])), "b")
    monkeypatch.setattr(comparing, "run", stop)
    found = compare_sides(first, side)
    assert found.stopped
    assert not found.same
    assert [one.what for one in found.differences] == ["mass"]


def test_it_is_a_name_of_the_package(folder: Path) -> None:
    assert sonic_bullet.compare is compare
    with pytest.raises(CompareError, match="no file"):
        sonic_bullet.compare(folder / "nothing.py", folder / "nothing.py")
