"""A log sounds the same again: saved, read elsewhere, without PyBullet; and the same scene twice is the same bytes."""

from __future__ import annotations

import hashlib
import subprocess
import sys
from pathlib import Path
from typing import Any

import numpy as np
import pytest

import sonic_bullet as sb
from sonic_bullet.records.contacts import ROW_FIELDS
from sonic_bullet.simulators import direct_client, disconnect
from tests.made.models import GLASS, WOOD, ball_body, box_model
from tests.made.worlds import EDGES_M, ball, box, floor, plate_model, sounding_box

SENSORS = (
    sb.Microphone([0, -1, 0.5]),
    sb.Microphone([0.7, 0.2, 0.4]),
    sb.Vibrometer(1, [0.09, 0.04, 0.005], [0, 0, 1]),
    sb.ModalSum(0.5),
)


def eventful(client: Any) -> sb.Listener:
    """Falling, sliding, a late body, one teleported, one removed, an id used again, a time step changed."""
    ground = floor(client)
    listener = sb.attach(client, microphone=SENSORS, seed=3)
    first = sounding_box(client, listener)
    assert first == 1
    listener.add(ground, material=WOOD, model=box_model((1, 1, 0.1), (90.0, 240.0), WOOD, seed=5))
    second = ball(client, (0.3, 0, 0.1))
    listener.add(second, material=GLASS, model=ball_body(0.02, GLASS).model)
    client.resetBaseVelocity(second, [1, 0, 0])
    for number in range(160):
        if number == 40:
            late = box(client, (0, 0, 0.35))
            listener.add(
                late, material=GLASS, model=box_model(EDGES_M, (1010.0, 2222.0), GLASS, seed=7), roughness_m=2e-6
            )
        if number == 70:
            client.resetBasePositionAndOrientation(first, [0.5, 0.5, 0.1], [0, 0, 0, 1])
        if number == 90:
            client.removeBody(second)
        if number == 100:
            assert ball(client, (0.5, 0.5, 0.3)) is not None
        if number == 130:
            client.setTimeStep(1 / 480)
        client.stepSimulation()
    return listener


@pytest.fixture(scope="module")
def log_and_sound(tmp_path_factory: pytest.TempPathFactory) -> tuple[Path, np.ndarray]:
    client = direct_client()
    client.setGravity(0, 0, -9.81)
    listener = eventful(client)
    path = tmp_path_factory.mktemp("log") / "eventful.npz"
    listener.contacts.save(path)
    sound = listener.sound()
    disconnect(client)
    return path, sound


def test_a_saved_log_sounds_the_same_bits(log_and_sound: tuple[Path, np.ndarray]) -> None:
    path, sound = log_and_sound
    assert (np.abs(sound).max(axis=1) > 1e-6).all()
    np.testing.assert_array_equal(sb.render_log(sb.read_log(str(path))), sound)


@pytest.mark.slow
def test_it_sounds_the_same_bits_in_a_process_without_pybullet(log_and_sound: tuple[Path, np.ndarray]) -> None:
    path, sound = log_and_sound
    script = """
import sys
class Blocker:
    def find_spec(self, name, path=None, target=None):
        if name.split(".")[0] in ("pybullet", "pybullet_utils", "pybullet_data"):
            raise ModuleNotFoundError(name)
sys.meta_path.insert(0, Blocker())
import hashlib, sonic_bullet as sb
print(hashlib.sha256(sb.render_log(sb.read_log(sys.argv[1])).tobytes()).hexdigest())
"""
    said = subprocess.run(
        [sys.executable, "-c", script, str(path)], check=True, timeout=200, capture_output=True, text=True
    ).stdout
    assert said.split() == [hashlib.sha256(np.ascontiguousarray(sound).tobytes()).hexdigest()]


def test_the_same_scene_twice_is_the_same_bytes(
    client: Any, log_and_sound: tuple[Path, np.ndarray], tmp_path: Path
) -> None:
    path, sound = log_and_sound
    listener = eventful(client)
    listener.contacts.save(tmp_path / "again.npz")
    assert (tmp_path / "again.npz").read_bytes() == path.read_bytes()
    listener.write(tmp_path / "again.wav")
    sb.write_audio(str(tmp_path / "first.wav"), sound, 48_000)
    assert (tmp_path / "again.wav").read_bytes() == (tmp_path / "first.wav").read_bytes()


def test_another_rate_sounds_alike(log_and_sound: tuple[Path, np.ndarray]) -> None:
    """The same log at 44.1 kHz: levels within 0.5 dB (the seeded surface differs between rates, strikes do not).
    Without supports: poles change at the bank's blocks, which begin elsewhere at another rate, and the next strike
    meets what rings in another phase.
    """
    from dataclasses import replace

    log = replace(sb.read_log(str(log_and_sound[0])), supports=False)
    sound, other = sb.render_log(log), sb.render_log(log, sr=44_100)
    assert other.shape[1] == int(sound.shape[1] * 44_100 / 48_000)
    level = 10 * np.log10((other**2).mean(axis=1) / (sound**2).mean(axis=1))
    assert np.abs(level).max() < 0.5


def test_what_a_step_hears_hangs_on_nothing_later(log_and_sound: tuple[Path, np.ndarray]) -> None:
    """Cut the log after any step: the sound up to there, less the steps it looks ahead, is the same bits."""
    from dataclasses import replace

    path, sound = log_and_sound
    log = sb.read_log(str(path))
    for steps in (20, 41, 91, 120):
        part = sb.render_log(replace(log, steps=log.steps[:steps]))
        safe = (steps - 3) * 200
        np.testing.assert_array_equal(part[:, :safe], sound[:, :safe])


def test_plate_model_is_heard_by_the_vibrometer_alone_where_it_looks(log_and_sound: tuple[Path, np.ndarray]) -> None:
    """The vibrometer reads its body's velocity: without that body's modes and mass it reads nothing."""
    from dataclasses import replace

    path, sound = log_and_sound
    log = sb.read_log(str(path))
    bodies = tuple(
        replace(b, model=replace_modes(b.model), mass_kg=0.0) if b.body_id == 1 and b.model is not None else b
        for b in log.bodies
    )
    silent = sb.render_log(replace(log, bodies=bodies, steps=log.steps[:60]))
    assert not silent[2].any()
    assert np.abs(sound[2, : 60 * 200]).max() > 0


def replace_modes(model: Any) -> Any:
    from dataclasses import replace

    return replace(model, freq_hz=np.zeros(0), decay_per_s=np.zeros(0), shape=np.zeros((len(model.vertex_m), 3, 0)))


def test_an_empty_log_is_silence_of_no_length(client: Any, tmp_path: Path) -> None:
    listener = sb.attach(client)
    assert listener.sound().shape == (1, 0)
    listener.contacts.save(tmp_path / "none.npz")
    assert sb.render_log(sb.read_log(str(tmp_path / "none.npz"))).shape == (1, 0)
    assert plate_model().mode_count == 4


def test_a_log_turned_as_a_whole_sounds_the_same(log_and_sound: tuple[Path, np.ndarray]) -> None:
    """Poses, normals, impulses, slips, gravity and microphones rotated and moved: nothing relative changes."""
    from dataclasses import replace

    from scipy.spatial.transform import Rotation

    path, sound = log_and_sound
    log = sb.read_log(str(path))
    turn, shift = Rotation.from_rotvec([0.7, -1.1, 2.0]), np.array([3.0, -2.0, 5.0])

    def turned(vectors: np.ndarray) -> np.ndarray:
        return vectors @ turn.as_matrix().T

    steps = tuple(
        replace(
            step,
            position_m=turned(step.position_m) + shift,
            quaternion_xyzw=(turn * Rotation.from_quat(step.quaternion_xyzw.copy())).as_quat()
            if len(step.quaternion_xyzw)
            else step.quaternion_xyzw,
            gravity_m_s2=turned(step.gravity_m_s2),
            contacts=sb.Contacts(
                **{name: getattr(step.contacts, name) for name in ROW_FIELDS}
                | {name: turned(getattr(step.contacts, name)) for name in ("normal", "impulse_n_s", "slip_m_s")}
            ),
        )
        for step in log.steps
    )
    sensors = tuple(
        sb.Microphone(turned(s.position_m) + shift) if isinstance(s, sb.Microphone) else s for s in log.sensors
    )
    other = sb.render_log(replace(log, steps=steps, sensors=sensors))
    error = np.abs(other - sound).max(axis=1) / np.abs(sound).max(axis=1)
    print("turned:", error)
    assert error.max() < 1e-9
