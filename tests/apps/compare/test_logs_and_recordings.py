"""Logs tell the input that differs, recordings what became of them; neither tells more than it can know."""

from __future__ import annotations

from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest

from sonic_bullet.apps.compare import SceneSide, compare
from sonic_bullet.apps.compare.outcome.recording_effects import recording_effects
from sonic_bullet.apps.compare.outcome.sound_effects import sound_effects
from sonic_bullet.apps.compare.sides import Side, run
from sonic_bullet.files import write_audio
from sonic_bullet.files.contact_log import ContactLog
from sonic_bullet.records import Microphone
from sonic_bullet.records.errors import CompareError
from tests.apps.compare.made import scene
from tests.few_cases import parametrize_few

NO_INPUT = ("body_id", "link", "epoch", "name", "since_step", "until_step", "model")

SR = 48_000


@pytest.fixture(scope="module")
def side(tmp_path_factory: pytest.TempPathFactory) -> Side:
    return run(SceneSide(scene(tmp_path_factory.mktemp("logs"), "a.py")), "a")


@pytest.fixture(scope="module")
def log(side: Side) -> ContactLog:
    assert side.log is not None
    return side.log


def test_a_log_is_the_scene_it_came_from(side: Side, log: ContactLog) -> None:
    found = compare(log, log)
    assert found.same
    assert np.array_equal(found.a.sound.samples(), side.sound.samples())


def test_where_contacts_are_equal_an_input_of_a_log_is_exchanged(log: ContactLog) -> None:
    bar = next(i for i, body in enumerate(log.bodies) if body.name == "bar")
    rough = replace(log.bodies[bar].material, roughness_m=3e-6)  # type: ignore[type-var]
    bodies = [replace(x, material=rough) if i == bar else x for i, x in enumerate(log.bodies)]
    moved = replace(log, bodies=tuple(bodies), sensors=(Microphone(np.array([0.0, -0.42, 0.3])),))
    found = compare(log, moved)
    assert found.exact
    assert "microphones" in [one.what for one in found.causes]
    assert found.effects[0].words == "contacts are equal in every step"


def test_where_contacts_differ_a_log_says_that_no_share_is_known(tmp_path: Path, log: ContactLog) -> None:
    heavier = run(SceneSide(scene(tmp_path, "b.py", ("        0.004,", "        0.0044,"))), "b").log
    assert heavier is not None
    found = compare(log, heavier)
    assert (found.differences[0].who, found.differences[0].what) == ("ball", "mass")
    assert not found.causes
    assert found.exact is None
    assert "share not determinable" in found.notes[0]


def test_a_new_field_of_a_record_is_an_input_by_itself(log: ContactLog) -> None:
    from sonic_bullet.apps.compare.inputs.matched_logs import body_inputs

    body = log.bodies[0]
    known = set(body_inputs(body))
    from dataclasses import fields

    assert {one.name for one in fields(body)} - set(NO_INPUT) - {"dynamics"} <= known


def test_an_empty_log_and_two_of_one_name_are_refused(log: ContactLog) -> None:
    with pytest.raises(CompareError, match="empty log"):
        compare(replace(log, steps=log.steps[:0], events=(), changes=()), log)
    bodies = tuple(replace(body, name="same") for body in log.bodies)
    with pytest.raises(CompareError, match="two bodies are called 'same'"):
        compare(replace(log, bodies=bodies), log)


def ringing(seed: int = 0) -> np.ndarray[tuple[int, int], np.dtype[np.float64]]:
    rng, t = np.random.default_rng(seed), np.arange(SR // 2) / SR
    tones = [
        np.exp(-12 * t) * np.sin(2 * np.pi * f * t + p) for f, p in zip((430, 1170, 5210), rng.random(3), strict=True)
    ]
    burst = rng.normal(0, 0.3, len(t)) * np.exp(-40 * t)
    return np.stack([sum(tones) + burst, 0.7 * np.roll(sum(tones), 30) + 0.5 * burst[::-1]])


CHANGES = {
    "gain": lambda x: x * 10 ** (0.5 / 20),
    "delay": lambda x: np.pad(x, ((0, 0), (48, 0)))[:, : x.shape[1]],
    "channels": lambda x: x[::-1],
    "polarity": lambda x: -x,
    "clipping": lambda x: np.clip(x, -0.4, 0.4),
    "filter": lambda x: 0.5 * (x + np.pad(x, ((0, 0), (1, 0)))[:, :-1]),
    "noise": lambda x: x + np.random.default_rng(1).normal(0, 0.001, x.shape),
    "tone": lambda x: x + 0.002 * np.sin(2 * np.pi * 50 * np.arange(x.shape[1]) / SR),
    "offset": lambda x: x + 0.02,
    "gap": lambda x: np.where((np.arange(x.shape[1]) // 1000 == 3), 0.0, x),
    "silence": lambda x: x * 0,
}


@pytest.mark.parametrize("kind", CHANGES)
def test_what_became_of_a_recording_is_described(kind: str) -> None:
    x = ringing()
    found = recording_effects(x, CHANGES[kind](x), SR)
    assert found[0].kind == kind
    if kind == "gain":
        assert found[0].values["gain_db"] == pytest.approx(0.5, abs=1e-6)
    if kind == "delay":
        assert found[0].values["delay_s"] == pytest.approx(1e-3)


def test_recordings_name_no_cause_and_rates_are_compared_at_the_lower(tmp_path: Path) -> None:
    x = ringing()
    write_audio(str(tmp_path / "a.wav"), x, SR)
    write_audio(str(tmp_path / "b.wav"), x[:, : SR // 4], 44_100)
    found = compare(tmp_path / "a.wav", tmp_path / "b.wav")
    assert not found.same
    assert found.differences == ()
    assert "compared at 44100 Hz" in found.effects[0].words
    assert compare(tmp_path / "a.wav", tmp_path / "a.wav").same


@parametrize_few("decay_per_s", [0.0, 40.0], 1)
def test_recordings_that_have_nothing_in_common_are_said_to_have_nothing(decay_per_s: float) -> None:
    rng, n, sr = np.random.default_rng(35), 12_000, 48_000
    fade = np.exp(-decay_per_s * np.arange(n) / sr)
    alone = [recording_effects(*(fade * rng.normal(size=(2, 1, n))), sr)[0].kind for _ in range(40)]
    assert alone.count("unrelated") >= 37  # chance passes 1 in 100: more than 3 of 40 has a probability of 8e-4
    x = fade * rng.normal(size=(1, n))
    noise = rng.normal(size=(1, n)) * np.sqrt(np.square(x).mean() * 10)
    assert recording_effects(x, x + noise, sr)[0].kind == "noise"  # 10 dB above what is in common


def test_of_unrelated_recordings_no_more_is_said(tmp_path: Path) -> None:
    rng = np.random.default_rng(3)
    write_audio(str(tmp_path / "a.wav"), ringing(), SR)
    write_audio(str(tmp_path / "b.wav"), rng.normal(0, 0.1, (2, SR // 4)), SR)
    found = compare(tmp_path / "a.wav", tmp_path / "b.wav")
    assert [one.kind for one in found.effects] == ["length", "unrelated"]
    assert "nothing in common" in found.lines()[-1]


@pytest.mark.parametrize(
    ("first", "said"), [(0, "differ from the first sample on"), (480, "equal for the first 10 ms")]
)
def test_since_when_sounds_differ_is_said(first: int, said: str) -> None:
    x = ringing()
    y = x.copy()
    y[:, first] += 0.1
    effect = sound_effects(x, y, SR)[0]
    assert effect.kind == "sample" and said in effect.words
