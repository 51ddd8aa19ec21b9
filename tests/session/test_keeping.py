"""What a listener keeps of a run: all, part or nothing of it, the same sound; beyond memory, and on a full disk."""

from __future__ import annotations

import tempfile
from pathlib import Path
from typing import Any

import numpy as np
import pytest

import sonic_bullet as sb
from sonic_bullet.files.rows import log_steps
from sonic_bullet.files.storage import spool
from sonic_bullet.records.errors import AudioError, FileError, RecordError, SceneError, SceneWarning
from sonic_bullet.simulators import direct_client, disconnect
from tests.made.disks import full_disk
from tests.made.logs import same
from tests.made.worlds import floor, sounding_box

STEPS = 120


def run(client: Any, steps: int = STEPS, every: int | None = None, **how: Any) -> tuple[Any, np.ndarray, np.ndarray]:
    """A box falls; the listener, its frames, and what `read` gave, asked every so many steps or at the end."""
    floor(client)
    listener = sb.attach(client, microphone=[(0, -1, 0.5), (1, 0, 0.5)], **how)
    sounding_box(client, listener)
    frames, read = [], []
    for number in range(1, steps + 1):
        client.stepSimulation()
        frames.append(listener.frame)
        if number % (every or steps) == 0:
            read.append(listener.read())
    return listener, np.concatenate(frames, axis=1), np.concatenate(read, axis=1)


@pytest.fixture
def little_memory(monkeypatch: pytest.MonkeyPatch, tmp_path: Path) -> Path:
    """Spools that go to the disk after a few steps; the folder where they lie."""
    monkeypatch.setattr(tempfile, "tempdir", str(tmp_path))
    monkeypatch.setattr(spool, "MEMORY_BYTES", 2000)
    monkeypatch.setattr(spool, "BLOCK_BYTES", 1000)
    monkeypatch.setattr(log_steps, "PACKED", 2)
    return tmp_path


@pytest.fixture
def usual() -> Any:
    """Log and sound of the same run, kept in memory."""
    client = direct_client()
    client.setGravity(0, 0, -9.81)
    listener, frames, _ = run(client)
    disconnect(client)
    assert np.abs(frames).max() > 0.01
    return listener.contacts, listener.sound(), frames


def test_on_disk_it_is_what_it_is_in_memory(client: Any, usual: Any, little_memory: Path) -> None:
    log, sound, frames = usual
    listener, live, read = run(client)
    assert (live == frames).all() and (read == frames).all()
    assert (listener.sound() == sound).all() and same(listener.contacts, log)
    assert (sb.render_log(listener.contacts) == sound).all()
    listener.write(little_memory / "a.wav")
    assert [one.name for one in little_memory.iterdir()] == ["a.wav"]
    again, rate = sb.files.read_audio(little_memory / "a.wav")[:2]
    assert (again == sound.astype(np.float32)).all() and rate == listener.sr


@pytest.mark.parametrize("kept", [(False, True), (True, False), (False, False)])
def test_what_is_not_kept_is_an_error_that_names_the_option_and_the_rest_stays(
    client: Any, usual: Any, kept: tuple[bool, bool]
) -> None:
    log, sound, frames = usual
    listener, live, read = run(client, every=7, keep_log=kept[0], keep_sound=kept[1])
    assert (live == frames).all() and (read == frames[:, : read.shape[1]]).all()
    if kept[0]:
        assert same(listener.contacts, log)
    else:
        with pytest.raises(SceneError, match="keep_log=True"):
            _ = listener.contacts
    if kept[1]:
        assert (listener.sound() == sound).all()
        return
    for call in (listener.sound, listener.kept_sound, lambda: listener.write("a.wav")):
        with pytest.raises(AudioError, match="keep_sound=True"):
            call()
    assert not Path("a.wav").exists()


@pytest.mark.parametrize("name", ["keep_log", "keep_sound"])
def test_what_is_no_flag_is_refused(client: Any, name: str) -> None:
    with pytest.raises(RecordError, match=f"{name} is 'no'"):
        sb.attach(client, **{name: "no"})


def test_on_a_full_disk_frames_go_on_and_what_was_kept_stays(client: Any, usual: Any, little_memory: Path) -> None:
    log, sound, frames = usual
    with full_disk(20_000), pytest.warns(SceneWarning, match="is not kept.*TMPDIR"):
        listener, live, _ = run(client, every=1)
        listener.quench()  # an event of a step that the log has not
    assert (live == frames).all()
    assert len(listener.notes) == 2 and all("full" in one or "large" in one for one in listener.notes)
    assert any("contact log" in one and "keep_log=False" in one for one in listener.notes)
    assert any("sound" in one and "keep_sound=False" in one for one in listener.notes)
    first, part = listener.contacts, listener.sound()
    assert 10 < len(first.steps) < STEPS and same(tuple(first.steps), tuple(log.steps[: len(first.steps)]))
    assert first.events == ()
    assert 1000 < part.shape[1] < sound.shape[1] and (part == sound[:, : part.shape[1]]).all()
    first.save(little_memory / "a.npz")
    listener.write(little_memory / "a.wav")
    assert same(tuple(sb.read_log(little_memory / "a.npz").steps), tuple(first.steps))


def test_frames_that_nobody_reads_go_to_the_disk_too(client: Any, usual: Any, little_memory: Path) -> None:
    with full_disk(30_000), pytest.warns(SceneWarning, match=r"unread frames are not kept.*read\(\)"):
        listener, _, read = run(client, keep_log=False, keep_sound=False)
    assert 1000 < read.shape[1] < usual[2].shape[1] and (read == usual[2][:, : read.shape[1]]).all()
    client.stepSimulation()
    assert (listener.read() == listener.frame).all()  # read, there is room again


def test_a_replay_in_blocks_is_the_replay(usual: Any, little_memory: Path) -> None:
    from sonic_bullet.engine.runtime.replay import render_blocks, render_kept

    log, sound, _ = usual
    blocks = [*render_blocks(log)]
    assert len(blocks) > 2 and (np.concatenate(blocks, axis=1) == sound).all()
    kept = render_kept(log)
    assert kept.spool.on_disk and (kept.samples() == sound).all()
    with full_disk(30_000), pytest.raises(FileError, match="sound") as caught:
        render_kept(log)
    part = caught.value.kept.samples()  # type: ignore[attr-defined]
    assert 1000 < part.shape[1] < sound.shape[1] and (part == sound[:, : part.shape[1]]).all()
