"""The system's cards, with a stand-in for sounddevice: what goes right, and every way in which it does not."""

from __future__ import annotations

import builtins
import sys
import time
from collections.abc import Callable
from typing import Any

import numpy as np
import pytest

from sonic_bullet.records.errors import AudioError
from sonic_bullet.session.live import sound_card, start_playback
from tests.made.sound_cards import StandInLibrary

SR = 48_000


@pytest.fixture
def install(monkeypatch: pytest.MonkeyPatch) -> Callable[..., StandInLibrary]:
    def put(**how: Any) -> StandInLibrary:
        library = StandInLibrary(**how)
        monkeypatch.setitem(sys.modules, "sounddevice", library)  # type: ignore[arg-type]
        return library

    return put


def noise(count: int) -> list[np.ndarray]:
    return list(np.random.default_rng(0).uniform(-1, 1, (count, 1, 200)))


@pytest.mark.parametrize(("held_s", "said_s"), [(0.02, 0.02), (None, 0.01)])
def test_a_card_gets_every_sample_once(
    install: Callable[..., StandInLibrary], held_s: float | None, said_s: float
) -> None:
    """held_s None: a system that leaves the clocks at zero; the stream's own latency stands for them."""
    library = install(held_s=held_s)
    frames = noise(60)
    with start_playback(None, sr=SR, channels=1, lag_steps=0, full_scale_pa=2.0) as sound:
        for frame in frames:
            sound.push(frame, time.perf_counter())
    (stream,) = library.streams
    out = np.concatenate(stream.taken)
    sent = (np.concatenate(frames, axis=1)[0] / 2).astype(np.float32)
    np.testing.assert_array_equal(out[:, 0][out[:, 0] != 0], sent)
    np.testing.assert_array_equal(out[:, 0], out[:, 1])  # one microphone sounds in both ears
    assert stream.closed
    assert stream.asked["dtype"] == "float32"
    report = sound.report
    assert report.card == "card 0"
    assert report.seconds == len(sent) / SR
    assert said_s < report.latency_median_s < said_s + 0.018 + 0.02 + 64 / SR


def test_several_microphones_need_as_many_channels(install: Callable[..., StandInLibrary]) -> None:
    library = install(channels=(2, 6))
    with pytest.raises(AudioError, match="card 0 has 2 channels, and there are 4 microphones; attach with 2 micro"):
        start_playback(None, sr=SR, channels=4, lag_steps=0)
    for device in (1, "card 1"):
        start_playback(device, sr=SR, channels=4, lag_steps=0).close()
    assert [stream.asked["channels"] for stream in library.streams] == [4, 4]
    assert [stream.asked["device"] for stream in library.streams] == [1, 1]


def test_one_channel_stays_one_where_the_card_has_one(install: Callable[..., StandInLibrary]) -> None:
    library = install(channels=(1,))
    start_playback(None, sr=SR, channels=1, lag_steps=0).close()
    assert library.streams[0].asked["channels"] == 1


@pytest.mark.parametrize(
    ("how", "device", "sr", "words"),
    [
        ({"channels": ()}, None, SR, "this machine has no sound card; connect one, or play to 'null'"),
        ({"channels": (0,)}, None, SR, "this machine has no sound card"),
        ({}, "radio", SR, "no sound card 'radio': No output device matching 'radio'; name one of: 0 card 0"),
        ({}, 7, SR, "no sound card 7: "),
        ({}, 1.5, SR, "device is 1.5; give a card's name or number"),
        ({}, True, SR, "device is True"),
        (
            {"sr": 44_100},
            None,
            SR,
            "card 0 does not take 48000 Hz on 2 channels: .*; attach with sr=44100, its own rate",
        ),
    ],
)
def test_what_a_card_cannot_is_one_line(
    install: Callable[..., StandInLibrary], how: dict[str, Any], device: Any, sr: int, words: str
) -> None:
    library = install(**how)
    with pytest.raises(AudioError, match=words) as caught:
        start_playback(device, sr=sr, channels=1, lag_steps=0)
    assert "\n" not in str(caught.value)
    assert library.streams == []


def test_a_card_in_use_is_said(install: Callable[..., StandInLibrary]) -> None:
    install().busy = True
    with pytest.raises(AudioError, match="card 0 cannot be opened: Device unavailable; close what uses it"):
        start_playback(None, sr=SR, channels=1, lag_steps=0)


def test_nobody_waits_for_a_card_that_does_not_close(
    install: Callable[..., StandInLibrary], monkeypatch: pytest.MonkeyPatch
) -> None:
    library, unregistered = install(), []
    monkeypatch.setattr(sound_card, "CARD_CLOSE_S", 0.05)
    monkeypatch.setattr(sound_card.atexit, "unregister", unregistered.append)
    library.hangs = True
    sound = start_playback(None, sr=SR, channels=1, lag_steps=0)
    begin = time.perf_counter()
    sound.close(abort=True)
    assert time.perf_counter() - begin < 5
    assert unregistered == [library._exit_handler]


@pytest.mark.parametrize(
    ("error", "words"),
    [
        (
            ModuleNotFoundError("No module named 'sounddevice'"),
            r"library sounddevice; pip install 'sonic_bullet\[live\]",
        ),
        (
            OSError("PortAudio library not found"),
            "PortAudio, which is not installed; install the package libportaudio2",
        ),
    ],
)
def test_what_is_not_installed_is_named(error: Exception, words: str, monkeypatch: pytest.MonkeyPatch) -> None:
    real = builtins.__import__

    def failing(name: str, *rest: Any) -> Any:
        if name == "sounddevice":
            raise error
        return real(name, *rest)

    monkeypatch.setattr(builtins, "__import__", failing)
    with pytest.raises(AudioError, match=words):
        start_playback(None, sr=SR, channels=1, lag_steps=0)
