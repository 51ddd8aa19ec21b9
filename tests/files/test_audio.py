"""What reaches a disk is whole, finite and said; what comes from one is checked before it is believed."""

from __future__ import annotations

import os
import subprocess
import sys
import time
from pathlib import Path

import numpy as np
import pytest
import soundfile
from hypothesis import given, settings
from hypothesis import strategies as st

from sonic_bullet import files
from sonic_bullet.files import audio
from sonic_bullet.records.errors import AudioError, FileError
from sonic_bullet.records.file_endings import AUDIO_FORMATS

SR = 48_000


def noise(seed: int = 0, channels: int = 2, frames: int = SR) -> np.ndarray:
    return np.random.default_rng(seed).normal(0, 0.1, (channels, frames))


def listing(folder: Path) -> list[str]:
    return sorted(p.name for p in folder.iterdir())


# ---- sample rate


@pytest.mark.parametrize("sr", [0, -1, 1e9, float("nan"), float("inf"), 44100.5, True, "fast", None, 7999, 384_001])
def test_bad_sample_rates_are_refused(sr: object) -> None:
    with pytest.raises(AudioError, match="sample rate"):
        files.check_sr(sr)


def test_whole_sample_rates_pass() -> None:
    assert [files.check_sr(x) for x in (8000, 48000.0, np.int64(44100), 384_000)] == [8000, 48000, 44100, 384_000]


# ---- audio


@pytest.mark.parametrize("extension", sorted(AUDIO_FORMATS))
def test_each_format_gives_back_what_was_written(tmp_path: Path, extension: str) -> None:
    sound = 0.3 * np.sin(np.arange(SR) * [[0.1], [0.2]])
    report = files.write_audio(tmp_path / f"a{extension}", sound, SR)
    back, sr = files.read_audio(tmp_path / f"a{extension}")
    assert (sr, back.shape, report.frames, report.channels, report.clipped) == (SR, sound.shape, SR, 2, 0)
    bound = {"FLOAT": 1e-7, "PCM_24": 2.0**-23, "VORBIS": 0.03}[report.subtype]
    assert np.abs(back - sound).max() < bound
    assert listing(tmp_path) == [f"a{extension}"]


def test_default_is_one_pascal_at_full_scale_in_float32(tmp_path: Path) -> None:
    sound = np.array([[0.25, -3.5, 1e-3]])
    report = files.write_audio(tmp_path / "a.wav", sound, SR)
    assert soundfile.info(tmp_path / "a.wav").subtype == "FLOAT"
    np.testing.assert_array_equal(files.read_audio(tmp_path / "a.wav")[0], sound.astype(np.float32).astype(float))
    assert (report.clipped, report.over, report.peak_pa) == (0, 1, 3.5)
    assert report.rms_pa == pytest.approx(np.sqrt(np.mean(sound**2)))


def test_integer_formats_clip_and_count(tmp_path: Path) -> None:
    sound = np.array([[0.5, 1.0, -1.0, 1.5, -2.0, 0.0]])
    report = files.write_audio(tmp_path / "a.wav", sound, SR, subtype="PCM_16")
    assert report.clipped == 2
    np.testing.assert_allclose(files.read_audio(tmp_path / "a.wav")[0], np.clip(sound, -1, 1), atol=2.0**-15)


@pytest.mark.parametrize("target", [-1.0, -20.0, 0.0])
def test_peak_is_what_was_asked(tmp_path: Path, target: float) -> None:
    files.write_audio(tmp_path / "a.wav", noise() * 1e-6, SR, peak_dbfs=target)
    assert 20 * np.log10(np.abs(soundfile.read(tmp_path / "a.wav")[0]).max()) == pytest.approx(target, abs=1e-5)


@pytest.mark.parametrize("gain", [1e-7, 1.0, 1e3])
def test_loudness_is_what_was_asked_however_quiet_the_sound(tmp_path: Path, gain: float) -> None:
    import pyloudnorm

    files.write_audio(tmp_path / "a.wav", noise() * gain, SR, lufs=-23.0)
    assert pyloudnorm.Meter(SR).integrated_loudness(soundfile.read(tmp_path / "a.wav")[0]) == pytest.approx(
        -23, abs=1e-3
    )


def test_full_scale_divides(tmp_path: Path) -> None:
    files.write_audio(tmp_path / "a.wav", np.full((1, 8), 3.0), SR, full_scale_pa=4.0)
    np.testing.assert_allclose(soundfile.read(tmp_path / "a.wav")[0], 0.75)
    np.testing.assert_allclose(files.read_audio(tmp_path / "a.wav")[0], 3.0)


@pytest.mark.parametrize(
    ("sound", "options", "words"),
    [
        (np.zeros((1, SR)), {"peak_dbfs": -1}, "silent"),
        (np.zeros((1, SR)), {"lufs": -23}, "silent"),
        (noise(frames=1000), {"lufs": -23}, "0.4 s"),
        (noise(), {"lufs": -3, "peak_dbfs": -20}, "cannot be reached"),
        (noise(), {"peak_dbfs": float("nan")}, "peak_dbfs"),
        (noise(channels=6), {"lufs": -23}, "5 channels"),
        (noise(), {"full_scale_pa": 0.0}, "full_scale_pa"),
        (np.array([[0.0, np.nan]]), {}, "sample 1 of channel 0"),
        (np.array([[0.0], [np.inf]]), {}, "sample 0 of channel 1"),
        (np.array([[0.0, np.nan]]), {"peak_dbfs": -1}, "NaN"),
        (np.array([[1e39]]), {}, "finite"),
        (np.zeros((0, 5)), {}, "shape"),
    ],
)
def test_what_cannot_be_written_is_one_error_and_no_file(
    tmp_path: Path, sound: np.ndarray, options: dict[str, float], words: str
) -> None:
    with pytest.raises(AudioError, match=words):
        files.write_audio(tmp_path / "a.wav", sound, SR, **options)
    assert listing(tmp_path) == []


def test_tails_hold_no_subnormals(tmp_path: Path) -> None:
    tail = np.exp(-np.arange(4000) / 20.0)[None, :]
    assert ((tail.astype(np.float32) != 0) & (np.abs(tail) < 2.0**-126)).any()
    files.write_audio(tmp_path / "a.wav", tail, SR)
    back = soundfile.read(tmp_path / "a.wav", dtype="float32")[0]
    assert not ((back != 0) & (np.abs(back) < 2.0**-126)).any()


@pytest.mark.parametrize("extension", [e for e in sorted(AUDIO_FORMATS) if e != ".ogg"])
def test_the_same_samples_give_the_same_bytes_at_another_second(tmp_path: Path, extension: str) -> None:
    files.write_audio(tmp_path / f"a{extension}", noise(), SR)
    time.sleep(1.05 - time.time() % 1)  # libsndfile's PEAK chunk would hold the second
    files.write_audio(tmp_path / f"b{extension}", noise(), SR)
    assert (tmp_path / f"a{extension}").read_bytes() == (tmp_path / f"b{extension}").read_bytes()


@settings(max_examples=15, deadline=None)
@given(cuts=st.lists(st.integers(0, 3000), max_size=5))
def test_blocks_do_not_change_the_bytes(tmp_path_factory: pytest.TempPathFactory, cuts: list[int]) -> None:
    folder = tmp_path_factory.mktemp("blocks")
    sound = noise(frames=3000)
    files.write_audio(folder / "whole.wav", sound, SR)
    with files.AudioWriter(folder / "blocks.wav", SR, 2) as writer:
        for block in np.split(sound, sorted(cuts), axis=1):
            writer.write(block)
    assert (folder / "whole.wav").read_bytes() == (folder / "blocks.wav").read_bytes()


@pytest.mark.parametrize("error", [KeyboardInterrupt(), AudioError("what", "remedy"), ZeroDivisionError()])
def test_an_interrupted_write_leaves_a_valid_partial_file_and_names_it(tmp_path: Path, error: BaseException) -> None:
    (tmp_path / "a.wav").write_bytes(b"old")

    def work() -> None:
        with files.AudioWriter(tmp_path / "a.wav", SR, 1) as writer:
            writer.write(np.full((1, 480), 0.5))
            raise error

    with pytest.raises(type(error)) as caught:
        work()
    said = str(caught.value) + " ".join(getattr(caught.value, "__notes__", []))
    assert str(tmp_path / "a.partial.wav") in said
    assert "0.010 s" in said
    np.testing.assert_array_equal(files.read_audio(tmp_path / "a.partial.wav")[0], np.full((1, 480), 0.5))
    assert (tmp_path / "a.wav").read_bytes() == b"old"


FULL_DISK = """
import resource, sys, numpy as np
from sonic_bullet import files
from sonic_bullet.files.contact_log import ContactLog
from sonic_bullet.records import errors
from sonic_bullet.records.contacts import Contacts, Step
sound = np.random.default_rng(0).normal(0, 0.1, (1, 200_000))
step = Step(0.01, np.zeros((0, 3)), np.zeros((0, 4)), np.zeros(0, bool), Contacts.none())
log = ContactLog((), (step,) * 9999, (), 8000, 0)
resource.setrlimit(resource.RLIMIT_FSIZE, (300_000, 300_000))
for call in (lambda: files.write_audio("a.wav", sound, 48000), \
lambda: files.write_audio("b.flac", sound, 48000), lambda: files.write_log("c.npz", log)):
    try:
        call()
    except errors.FileError as error:
        print(error)
"""


def test_a_full_disk_is_one_error_each_and_no_file_under_its_name(tmp_path: Path) -> None:
    done = subprocess.run(
        [sys.executable, "-c", FULL_DISK], cwd=tmp_path, check=False, capture_output=True, text=True, timeout=120
    )
    assert [line[:18] for line in done.stdout.splitlines()] == [
        "cannot write a.wav",
        "cannot write b.fla",
        "cannot write c.npz",
    ], done.stderr
    assert set(listing(tmp_path)) <= {"a.partial.wav", "b.partial.flac"}


def test_two_writers_of_one_name_do_not_mix(tmp_path: Path) -> None:
    sounds = [noise(seed) for seed in (1, 2)]
    first, second = (files.AudioWriter(tmp_path / "a.wav", SR, 2) for _ in sounds)
    with first, second:
        for start in range(0, SR, 1000):
            first.write(sounds[0][:, start : start + 1000])
            second.write(sounds[1][:, start : start + 1000])
    assert listing(tmp_path) == ["a.wav"]
    # closed last
    np.testing.assert_array_equal(files.read_audio(tmp_path / "a.wav")[0], sounds[0].astype(np.float32).astype(float))


def test_over_four_gibibytes_wav_becomes_rf64_and_a_stream_stops_whole(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setattr(audio, "CHUNK_LIMIT_BYTES", 4000)
    report = files.write_audio(tmp_path / "a.wav", noise(channels=1, frames=1001), SR)
    assert (report.format, soundfile.info(tmp_path / "a.wav").format, (tmp_path / "a.wav").read_bytes()[:4]) == (
        "RF64",
        "RF64",
        b"RF64",
    )
    assert files.read_audio(tmp_path / "a.wav")[0].shape == (1, 1001)
    assert files.write_audio(tmp_path / "b.w64", noise(channels=1, frames=1001), SR).format == "W64"
    with pytest.raises(AudioError, match="4 GiB"), files.AudioWriter(tmp_path / "c.wav", SR, 1) as writer:
        for _ in range(3):
            writer.write(noise(channels=1, frames=400))
    assert files.read_audio(tmp_path / "c.partial.wav")[0].shape == (1, 800)


@pytest.mark.parametrize("name", ["a.txt", "a", "a.wav.exe", "no/such/folder/a.wav", "/proc/a.wav", "", "a\0.wav"])
def test_a_place_that_cannot_be_written_is_one_line(tmp_path: Path, name: str) -> None:
    with pytest.raises(FileError) as caught:
        files.write_audio(str(tmp_path / name) if name else name, noise(), SR)
    assert "\n" not in str(caught.value)
    assert listing(tmp_path) == []


def test_folders_and_devices_are_not_replaced(tmp_path: Path) -> None:
    (tmp_path / "a.wav").mkdir()
    os.mkfifo(tmp_path / "b.wav")
    for name, words in (("a.wav", "folder"), ("b.wav", "regular")):
        with pytest.raises(FileError, match=words):
            files.write_audio(tmp_path / name, noise(), SR)
    assert listing(tmp_path) == ["a.wav", "b.wav"]


def test_a_link_is_followed(tmp_path: Path) -> None:
    (tmp_path / "real").mkdir()
    (tmp_path / "a.wav").symlink_to(tmp_path / "real" / "b.wav")
    files.write_audio(tmp_path / "a.wav", noise(), SR)
    assert (tmp_path / "a.wav").is_symlink()
    assert listing(tmp_path / "real") == ["b.wav"]


def test_unknown_sample_format_lists_the_known(tmp_path: Path) -> None:
    with pytest.raises(FileError, match="PCM_24"):
        files.write_audio(tmp_path / "a.flac", noise(), SR, subtype="FLOAT")


def test_too_many_channels_for_the_format(tmp_path: Path) -> None:
    with pytest.raises(AudioError, match="9 channels"):
        files.write_audio(tmp_path / "a.flac", noise(channels=9), SR)
    assert listing(tmp_path) == []


def test_reading_what_is_no_audio(tmp_path: Path) -> None:
    (tmp_path / "a.wav").write_bytes(b"RIFFxxxx")
    for name in ("a.wav", "none.wav"):
        with pytest.raises(FileError, match="cannot read"):
            files.read_audio(tmp_path / name)
