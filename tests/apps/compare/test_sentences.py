"""Sentences of a comparison say what is meant in one reading: who, from where to where, which way, in which unit."""

from __future__ import annotations

import re

import numpy as np
import pytest

from sonic_bullet.apps.compare.outcome.recording_effects import recording_effects
from sonic_bullet.apps.compare.outcome.sound_effects import sound_effects
from sonic_bullet.apps.compare.tolerance import closeness, measure_sound
from sonic_bullet.apps.compare.words import change_words
from sonic_bullet.records import Microphone

SR = 16_000


def ring(freq_hz: float, level: float = 1.0, start_s: float = 0.1) -> np.ndarray:
    """A tone (1, n) that begins at a time and dies away."""
    t = np.arange(SR) / SR - start_s
    return np.asarray(np.where(t >= 0, level * np.exp(-8 * t) * np.sin(2 * np.pi * freq_hz * t), 0.0))[None]


def words(a: np.ndarray, b: np.ndarray) -> dict[str, str]:
    return {one.kind: one.words for one in sound_effects(a, b, SR)}


@pytest.mark.parametrize(
    ("start", "stop", "distance"),
    [
        ((0, -1, 0.5), (0, -1.01, 0.5), "1 cm"),
        ((0, -1, 0.5), (0, -1, 0.502), "2 mm"),
        ((0.1, -1, 0.5), (0.1, 2, 4.5), "5 m"),
        ((0, -0.4, 0.3), (0, -0.42, 0.3), "2 cm"),
    ],
)
def test_a_microphone_that_moved_says_from_where_to_where(
    start: tuple[float, ...], stop: tuple[float, ...], distance: str
) -> None:
    said = change_words("microphones", [Microphone(np.array(start))], [Microphone(np.array(stop))])
    places = [tuple(map(float, found.split(","))) for found in re.findall(r"\(([^)]+)\)", said)]
    assert places == [start, stop]
    assert said.startswith(f"microphone 1 moved by {distance}, from (") and said.endswith(") m") and " to (" in said


def test_a_body_that_starts_elsewhere_says_both_places_and_how_far() -> None:
    said = change_words("start position", (0.0, 0.0, 0.25), (0.0, 0.003, 0.25))
    assert said == "start position (0, 0, 0.25) → (0, 0.003, 0.25) m (moved by 3 mm)"


@pytest.mark.parametrize(("factor", "way"), [(0.562, "5 dB quieter"), (2.0, "6 dB louder"), (0.5, "6 dB quieter")])
def test_a_level_says_which_of_the_two_is_louder_and_where_most(factor: float, way: str) -> None:
    said = words(ring(1000), factor * ring(1000))["level"]
    assert said.startswith(f"B is {way}") and "than A in all" in said
    assert words(factor * ring(1000), ring(1000))["level"].startswith(f"B is {way[:4]}")
    other = words(ring(250), ring(250) + 0.05 * ring(4000))["level"]
    assert re.search(r"; most in the octave at 4 kHz: \d+ dB louder$", other)


@pytest.mark.parametrize("late_s", [0.02, -0.03, 0.05])
def test_an_onset_says_when_it_comes_and_by_how_much_it_is_late(late_s: float) -> None:
    said = words(ring(1000), ring(1000, start_s=0.1 + late_s))["onset"]
    found = re.search(r"the one at (\S+) s in A (\S+) ms (later|earlier) in B", said)
    assert found and float(found[1]) == pytest.approx(0.1, abs=0.005)
    assert float(found[2]) == pytest.approx(abs(late_s) * 1e3, abs=3)
    assert (found[3] == "later") == (late_s > 0)


def test_recordings_say_what_is_added_and_how_strong() -> None:
    tone = 0.01 * np.sin(2 * np.pi * 440 * np.arange(SR) / SR)
    (said,) = (one.words for one in recording_effects(ring(1000), ring(1000) + tone, SR) if one.kind == "tone")
    assert re.fullmatch(r"a tone at 440\.\d Hz is added, \d+\.\d dB below A as a whole", said)
    (gain,) = (one.words for one in recording_effects(ring(1000), 0.5 * ring(1000), SR) if one.kind == "gain")
    assert gain == "B is A, 6.02 dB quieter"


def test_a_tolerance_says_where_and_which_way() -> None:
    found = closeness(measure_sound(ring(1000), SR), measure_sound(1.5 * ring(1000), SR), 1.0)
    assert not found.within
    assert re.search(r"differ most at \d+ Hz, where the second sound is 3\.5 dB louder", found.words)
