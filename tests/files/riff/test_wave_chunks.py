"""Cue points and time reference, read back by another library (wavinfo) and by libsndfile."""

from __future__ import annotations

import struct
from pathlib import Path

import numpy as np
import pytest

from sonic_bullet.files import AudioWriter, read_audio, write_audio
from sonic_bullet.files.riff.wave_chunks import wave_chunks
from sonic_bullet.records.cues import Cue
from sonic_bullet.records.errors import FileError, RecordError
from tests.made.disks import full_disk

LAST_SAMPLE = 2**32 - 1
CHUNK_TEXT_BYTES = 200

CUES = (Cue(0, 0, "impact a - b 3 mN·s"), Cue(777, 500, "roll x - y"), Cue(999, 0, "odd"), Cue(2000, 0, ""))


def chunk_names(path: Path) -> list[bytes]:
    """The chunks of a RIFF file in order; their sizes add up to the file's."""
    data = path.read_bytes()
    assert data[8:12] == b"WAVE"
    names, at = [], 12
    while at < len(data):
        name, size = struct.unpack_from("<4sI", data, at)
        if name == b"data" and size == LAST_SAMPLE:
            size = struct.unpack_from("<Q", data, 28)[0]  # of ds64
        names.append(name)
        at += 8 + size + size % 2
    assert at == len(data)
    if data[:4] == b"RIFF":
        assert struct.unpack_from("<I", data, 4)[0] == len(data) - 8
    else:
        assert struct.unpack_from("<Q", data, 20)[0] == len(data) - 8
    return names


@pytest.mark.parametrize(("subtype", "channels"), [(None, 2), ("PCM_24", 1), ("PCM_16", 1)])
def test_cues_are_read_back_by_another_library(tmp_path: Path, subtype: str | None, channels: int) -> None:
    wavinfo = pytest.importorskip("wavinfo")
    sound = np.random.default_rng(1).uniform(-0.5, 0.5, (channels, 4001))
    path = tmp_path / "a take.wav"
    write_audio(path, sound, 48_000, subtype=subtype, cues=CUES, time_reference=2**33 + 5)
    info = wavinfo.WavInfoReader(str(path), info_encoding="utf-8")
    assert info.data.frame_count == 4001
    assert info.bext.time_reference == 2**33 + 5
    assert info.bext.originator.startswith("sonic_bullet")
    assert info.bext.description.startswith("a take")
    found = list(info.cues.each_cue())
    assert [(name, place) for name, place in found] == [(i + 1, cue.sample) for i, cue in enumerate(CUES)]
    told = [info.cues.label_and_note(name)[0] for name, _ in found]
    assert [text or "" for text in told] == [cue.label for cue in CUES]
    assert info.cues.range(2) == 500
    plain = tmp_path / "plain.wav"
    write_audio(plain, sound, 48_000, subtype=subtype)
    assert np.array_equal(read_audio(path)[0], read_audio(plain)[0])
    assert chunk_names(path)[-3:] == [b"bext", b"cue ", b"LIST"]


def test_a_file_over_4_gib_has_them_too(tmp_path: Path) -> None:
    path = tmp_path / "long.wav"
    chunks = wave_chunks(CUES, time_reference=7)
    with AudioWriter(path, 48_000, 1, expected_frames=2**31, chunks=chunks) as writer:
        writer.write(np.zeros((1, 1000)))
    assert path.read_bytes()[:4] == b"RF64"
    assert chunk_names(path)[-3:] == [b"bext", b"cue ", b"LIST"]
    assert read_audio(path)[0].shape == (1, 1000)


def test_without_places_there_is_the_time_alone(tmp_path: Path) -> None:
    write_audio(tmp_path / "x.wav", np.zeros((1, 10)), 48_000, cues=[], time_reference=48_000)
    assert chunk_names(tmp_path / "x.wav")[-1] == b"bext"
    write_audio(tmp_path / "y.wav", np.zeros((1, 10)), 48_000)
    assert chunk_names(tmp_path / "y.wav")[-2:] == [b"iXML", b"bext"]


def test_what_does_not_fit_is_cut_or_left_out() -> None:
    long = wave_chunks([Cue(5, 0, "ü\0" * 500), Cue(2**40, 0, "beyond")])
    assert struct.unpack_from("<I", long, 8 + 602 + 8)[0] == 1
    label = long[long.index(b"labl") + 12 :]
    assert len(label.rstrip(b"\0")) <= CHUNK_TEXT_BYTES
    label.rstrip(b"\0").decode()
    with pytest.raises(RecordError, match="cue"):
        Cue(-1, 0, "x")


def test_only_a_wav_has_cues(tmp_path: Path) -> None:
    with pytest.raises(FileError, match=r"\.wav"):
        write_audio(tmp_path / "x.flac", np.zeros((1, 10)), 48_000, cues=CUES)
    assert list(tmp_path.iterdir()) == []


def test_a_disk_that_is_full_at_the_chunks_leaves_nothing(tmp_path: Path) -> None:
    many = [Cue(i, 0, "a name that takes room") for i in range(2000)]
    with full_disk(20_000), pytest.raises(FileError, match="cannot write"):
        write_audio(tmp_path / "x.wav", np.zeros((1, 1000)), 48_000, cues=many)
    assert list(tmp_path.iterdir()) == []
