"""What rests is silent, whatever restitution, threshold and step are; what bounces, rocks and taps is played."""

from __future__ import annotations

from typing import Any

import numpy as np
import pytest

import sonic_bullet as sb
from sonic_bullet.engine.runtime.sound_events import SoundEvent, find_sound_events
from sonic_bullet.files.contact_log import ContactLog
from sonic_bullet.simulators import direct_client, disconnect
from tests.few_cases import parametrize_few
from tests.made.models import STEEL, box_model
from tests.made.soundtracks import MICROPHONES

SHAPES = {
    "bar": (0.2, 0.03, 0.01),
    "box": (0.06, 0.05, 0.04),
    "plate": (0.2, 0.2, 0.006),
    "ball": (0.04, 0.04, 0.04),
}


def dropped(
    shape: str,
    restitution: float,
    step_s: float,
    *,
    height_m: float = 0.05,
    seconds: float = 2.5,
    threshold: float | None = 0.0,
    turn: Any = (0.05, 0.03, 0.0),
) -> tuple[ContactLog, tuple[SoundEvent, ...]]:
    """A steel body that falls on a floor; restitution: of the pair."""
    client = direct_client()
    edges = np.array(SHAPES[shape])
    try:
        client.setGravity(0, 0, -9.81)
        client.setTimeStep(step_s)
        if threshold is not None:
            client.setPhysicsEngineParameter(restitutionVelocityThreshold=threshold)
        ground = client.createMultiBody(
            0, client.createCollisionShape(client.GEOM_BOX, halfExtents=[1, 1, 0.1]), basePosition=[0, 0, -0.1]
        )
        made = (
            client.createCollisionShape(client.GEOM_SPHERE, radius=edges[0] / 2)
            if shape == "ball"
            else client.createCollisionShape(client.GEOM_BOX, halfExtents=(edges / 2).tolist())
        )
        body = client.createMultiBody(
            float(7850 * edges.prod()), made, basePosition=[0, 0, height_m + edges[2] / 2],
            baseOrientation=client.getQuaternionFromEuler(turn),
        )  # fmt: skip
        for one in (ground, body):
            client.changeDynamics(
                one, -1, restitution=restitution**0.5, lateralFriction=0.7, contactProcessingThreshold=0
            )
        listener = sb.attach(client, sr=8000, microphone=MICROPHONES[:1])
        model = box_model((edges[0], edges[1], edges[2]), (700.0, 2100.0), STEEL)
        listener.add(body, material=STEEL, model=model)
        for _ in range(round(seconds / step_s)):
            client.stepSimulation()
        log = listener.contacts
    finally:
        disconnect(client)
    return log, find_sound_events(log)


def hits(events: tuple[SoundEvent, ...], after_s: float = 0.0) -> list[SoundEvent]:
    return [one for one in events if one.kind == "impact" and one.start_s >= after_s]


@parametrize_few(
    ("shape", "restitution", "step_s"),
    [
        ("bar", 0.3, 1 / 240), ("bar", 0.6, 1 / 60), ("bar", 0.6, 1 / 240), ("bar", 0.5, 1 / 1000),
        ("box", 0.3, 1 / 60), ("box", 0.5, 1 / 240), ("box", 0.6, 1 / 1000), ("plate", 0.5, 1 / 60),
        ("plate", 0.6, 1 / 240), ("plate", 0.5, 1 / 1000), ("ball", 0.5, 1 / 60), ("ball", 0.6, 1 / 240),
        ("ball", 0.3, 1 / 240),
    ],
    (0, 1, 4, 5, 8, 9, 10),  # each shape, rebound and step
)  # fmt: skip
def test_a_body_at_rest_is_not_struck(shape: str, restitution: float, step_s: float) -> None:
    log, events = dropped(shape, restitution, step_s, seconds=2.2)
    assert hits(events)[0].speed_m_s > 0.7
    loaded = sum(bool(len(step.contacts)) for step in log.steps[round(1.7 / step_s) :])
    assert loaded > 0.2 * 0.5 / step_s  # it is touched all the time, and jitters there
    assert hits(events, 1.7) == []


@pytest.mark.slow
@parametrize_few(
    ("shape", "restitution", "step_hz"),
    [("bar", 0.7, 1000), ("box", 0.7, 1000), ("plate", 0.7, 1000), ("plate", 0.8, 1000), ("plate", 0.8, 500)],
    (0, 3),
)
def test_what_hardly_loses_speed_comes_to_silence_too(shape: str, restitution: float, step_hz: int) -> None:
    """A plate of restitution 0.8 jitters at 70 mm/s, and was struck as long as a ball would have bounced on.

    PyBullet's corners go on for ever at up to 7 g dt, and come as far as they go in one step: no energy is lost, and no
    flight is that short.
    """
    log, events = dropped(shape, restitution, 1 / step_hz, seconds=3.3)
    assert len(hits(events)) > 3
    late = [step.contacts.row for step, start in zip(log.steps, log.start_s, strict=True) if start > 2.8]
    assert max(row["impulse_n_s"].max(initial=0.0) for row in late) > 0, "it still is in contact, and is not struck"
    assert hits(events, 2.8) == []


def test_small_bounces_are_played_to_the_last() -> None:
    """A ball's at restitution 0.8 and 4000 steps a second, which stop losing speed at 10 mm/s: all that it is given."""
    step_s = 1 / 4000
    log, events = dropped("ball", 0.8, step_s, height_m=0.02, seconds=0.66, turn=(0, 0, 0))
    bounces = hits(events)
    speeds = np.array([one.speed_m_s for one in bounces if one.speed_m_s > 0.02])
    assert speeds[-1] < 0.03 and len(speeds) >= np.log(speeds[0] / speeds[-1]) / np.log(1 / 0.8) - 3
    load = np.array([np.einsum("ki,ki->", s.contacts.row["impulse_n_s"], s.contacts.row["normal"]) for s in log.steps])
    for one in bounces[: len(speeds) - 1]:
        given = np.abs(load[np.abs(np.array(log.start_s) - one.start_s) < 3 * step_s]).sum()
        assert one.impulse_n_s == pytest.approx(given, rel=0.01)


@pytest.mark.parametrize(("restitution", "height_m", "step_s"), [(0.5, 0.2, 1 / 240), (0.8, 0.1, 1 / 240),
                                                                (0.9, 0.05, 1 / 1000)])  # fmt: skip
def test_real_bounces_keep_their_impulses(restitution: float, height_m: float, step_s: float) -> None:
    """The first three of a ball give all that changes its momentum."""
    log, events = dropped("ball", restitution, step_s, height_m=height_m, seconds=1.2, turn=(0, 0, 0))
    bounces = hits(events)[:3]
    assert len(bounces) == 3
    assert bounces[0].speed_m_s == pytest.approx(np.sqrt(2 * 9.81 * height_m), rel=0.1)
    for one in bounces:
        given = [
            float(np.abs(row["impulse_n_s"] @ row["normal"]))
            for step, start in zip(log.steps, log.start_s, strict=False)
            if abs(start - one.start_s) < 3 * step_s
            for row in step.contacts.row
        ]
        assert one.impulse_n_s == pytest.approx(sum(given), rel=0.05)


@pytest.mark.parametrize("threshold", [None, 0.0])
@pytest.mark.parametrize("step_s", [1 / 240, 1 / 1000])
def test_a_fall_of_five_millimetres_is_a_tap(threshold: float | None, step_s: float) -> None:
    _, events = dropped("plate", 0.3, step_s, height_m=0.005, seconds=0.3, threshold=threshold, turn=(0, 0, 0))
    assert hits(events)[0].speed_m_s == pytest.approx(np.sqrt(2 * 9.81 * 0.005), rel=0.2)


@pytest.mark.parametrize(("shape", "turn"), [("plate", (0.4, 0, 0)), ("box", (0.5, 0, 0)), ("bar", (0, 0.6, 0))])
def test_what_falls_over_strikes_with_both_ends(shape: str, turn: Any) -> None:
    """On an edge or a corner, and then on the other one, while the first carries load."""
    _, events = dropped(shape, 0.3, 1 / 240, height_m=0.06, seconds=1.0, threshold=None, turn=turn)
    assert len([one for one in hits(events) if one.speed_m_s > 0.2]) >= 2
