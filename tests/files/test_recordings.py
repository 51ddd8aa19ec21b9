"""Recordings are read to their end, whatever they say of their length; what is none is one line of ours."""

from __future__ import annotations

import sys
from pathlib import Path

import numpy as np
import pytest
import soundfile

from sonic_bullet import files
from sonic_bullet.apps.cli import main
from sonic_bullet.files import recordings
from sonic_bullet.records.errors import FileError

SOUND = np.random.default_rng(0).normal(0, 0.1, (2, 300_001))


def flac(path: Path, samples: int | None = None) -> Path:
    """SOUND as FLAC, its STREAMINFO claiming ``samples`` (36 bits, 0: unknown) [RFC 9639, 8.2]."""
    soundfile.write(path, SOUND.T, 48_000, "PCM_24", format="FLAC")
    if samples is not None:
        data = path.read_bytes()
        word = int.from_bytes(data[18:26], "big") >> 36 << 36 | samples
        path.write_bytes(data[:18] + word.to_bytes(8, "big") + data[26:])
    return path


def test_a_flac_that_states_no_length_is_read_to_its_end(tmp_path: Path) -> None:
    whole, stream = (files.read_audio(flac(tmp_path / f"{n}.flac", n))[0] for n in (SOUND.shape[1], 0))
    assert whole.shape == SOUND.shape
    np.testing.assert_array_equal(whole, stream)


@pytest.mark.parametrize("samples", [(1 << 36) - 1, SOUND.shape[1] + 1, 1 << 30])
def test_a_flac_that_claims_more_than_it_holds_is_refused_before_memory_is(tmp_path: Path, samples: int) -> None:
    with pytest.raises(FileError, match=f"claims {samples} frames and holds 300001"):
        files.read_audio(flac(tmp_path / "a.flac", samples))


def test_silence_that_unpacks_beyond_memory_is_refused(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(recordings, "MOST_SAMPLES", 1 << 20)
    soundfile.write(tmp_path / "a.flac", np.zeros((1 << 20) + 1), 48_000, format="FLAC")
    assert (tmp_path / "a.flac").stat().st_size * recordings.UNPACKED < 1 << 20
    with pytest.raises(FileError, match="unpacks to more than 1048576 samples"):
        files.read_audio(tmp_path / "a.flac")
    # as long, and no longer than its bytes
    soundfile.write(tmp_path / "a.wav", np.zeros((1 << 20) + 1), 48_000, "PCM_16")
    assert files.read_audio(tmp_path / "a.wav")[0].shape == (1, (1 << 20) + 1)


@pytest.mark.parametrize("rate", [1, 100, 999, 10_000_001, 2**31 - 1])
def test_a_rate_that_no_recording_has_is_refused(
    tmp_path: Path, rate: int, monkeypatch: pytest.MonkeyPatch, capfd: pytest.CaptureFixture[str]
) -> None:
    soundfile.write(tmp_path / "a.wav", SOUND[0, :5000], rate)
    with pytest.raises(FileError, match=f"sampled at {rate} Hz"):
        files.read_audio(tmp_path / "a.wav")
    monkeypatch.setattr(sys, "argv", ["sonic-bullet", "features", str(tmp_path / "a.wav")])
    with pytest.raises(SystemExit, match="2"):
        main()
    assert capfd.readouterr().err.startswith("sonic-bullet: cannot read ")


def test_a_name_that_ends_in_raw_is_read_by_its_content(tmp_path: Path) -> None:
    flac(tmp_path / "a.flac").rename(tmp_path / "a.raw")
    assert files.read_audio(tmp_path / "a.raw")[0].shape == SOUND.shape
    (tmp_path / "b.raw").write_bytes(SOUND[0, :1000].astype("<f4").tobytes())
    with pytest.raises(FileError, match=r"b\.raw"):
        files.read_audio(tmp_path / "b.raw")


@pytest.mark.parametrize("name", ["x" * 5000 + ".wav", "a\0.wav", "\ud800.wav", "."])
def test_names_that_no_disk_holds_are_one_line(tmp_path: Path, name: str) -> None:
    with pytest.raises(FileError) as caught:
        files.read_audio(f"{tmp_path}/{name}")
    assert len(str(caught.value).encode("utf-8", "replace")) < 1000


@pytest.mark.parametrize("extension", [".wav", ".rf64", ".w64", ".flac", ".ogg", ".aiff", ".caf"])
def test_samples_are_those_of_libsndfile(tmp_path: Path, extension: str) -> None:
    files.write_audio(tmp_path / f"a{extension}", SOUND, 48_000)
    np.testing.assert_array_equal(
        files.read_audio(tmp_path / f"a{extension}")[0], soundfile.read(tmp_path / f"a{extension}", always_2d=True)[0].T
    )
