"""Of a script with several physics clients one is heard; the others are named, and can be chosen."""

from __future__ import annotations

from pathlib import Path

import pytest

from sonic_bullet.records.errors import SceneError
from sonic_bullet.scene import render_scene


@pytest.mark.shared
def test_a_second_client_is_named_and_can_be_chosen(shared_path: Path) -> None:
    path = shared_path / "faults" / "08-second-client" / "scene.py"
    first = render_scene(path, sr=8000, microphones=())
    (said,) = [note for note in first.notes if "client" in note]
    assert "client 1 of the script steps too and is not heard" in said and "--client 1" in said
    second = render_scene(path, sr=8000, microphones=(), client=1)
    (said,) = [note for note in second.notes if "client" in note]
    assert "client 0 of the script steps too" in said
    long, short = (max(body.inertia_kg_m2[1, 1] for body in one.log.bodies) for one in (first, second))
    assert long > 4 * short  # their bars are 0.24 and 0.1 m long


def test_one_client_needs_no_word_and_one_that_is_not_there_has_no_steps(tmp_path: Path) -> None:
    (tmp_path / "a.py").write_text(
        "import pybullet as p\np.connect(p.DIRECT)\n"
        "p.createMultiBody(0.1, p.createCollisionShape(p.GEOM_SPHERE, radius=0.02))\n"
        "for _ in range(4):\n    p.stepSimulation()\n"
    )
    assert not any("client" in note for note in render_scene(tmp_path / "a.py", sr=8000, microphones=()).notes)
    with pytest.raises(SceneError, match="made no physics step"):
        render_scene(tmp_path / "a.py", sr=8000, microphones=(), client=7)
