"""What radiating costs is computed once and kept: the same bits, and nothing broken is believed."""

from __future__ import annotations

from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest

from sonic_bullet.files.contact_log import ContactLog
from sonic_bullet.machine.parallel import one_thread
from sonic_bullet.radiation import far_field as radiation
from sonic_bullet.radiation import radiated as room
from sonic_bullet.records import Air, Microphone
from tests.made.models import STEEL, ball_body, box_model, step

MODEL = box_model((0.2, 0.1, 0.01), (740.0, 1230.0, 2950.0), STEEL)


def again(cache: Path, model=MODEL, air: Air | None = None):  # type: ignore[no-untyped-def]
    """As a new process would ask."""
    room.radiation_and_note.cache_clear()
    return room.radiation_of(model, air or Air(), cache)


def test_computed_once_and_the_same_bits(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    with one_thread():
        wanted = radiation.radiation(MODEL, Air())
    first = again(tmp_path)
    monkeypatch.setattr(radiation, "radiation", lambda *_: pytest.fail("computed again"))
    second = again(tmp_path)
    for was, one, two in zip(wanted, first, second, strict=True):
        assert was.tobytes() == one.tobytes() == two.tobytes()


def test_another_air_frequency_or_shape_is_another_entry(tmp_path: Path) -> None:
    again(tmp_path)
    changed = (
        again(tmp_path, air=Air(1.3, 343.0)),
        again(tmp_path, replace(MODEL, freq_hz=MODEL.freq_hz * 1.01)),
        again(tmp_path, replace(MODEL, shape=2 * MODEL.shape)),
    )
    assert len(list(tmp_path.glob("radiation-*.npz"))) == 4
    assert len({weight.tobytes() for weight, _ in changed}) == 3


@pytest.mark.parametrize("harm", ["cut", "foreign", "flipped", "shorter", "nan"])
def test_a_broken_entry_is_computed_again(tmp_path: Path, harm: str) -> None:
    wanted = again(tmp_path)
    (entry,) = tmp_path.glob("radiation-*.npz")
    whole = entry.read_bytes()
    if harm == "cut":
        entry.write_bytes(whole[: len(whole) // 2])
    elif harm == "foreign":
        entry.write_bytes(b"\x80\x04pickle?")
    elif harm == "flipped":  # the zip's checksums tell
        at = whole.index(wanted[1].tobytes())
        entry.write_bytes(whole[:at] + bytes([whole[at] ^ 1]) + whole[at + 1 :])
    else:
        real = wanted[0].real[:2] if harm == "shorter" else np.full(3, np.nan)
        room.store.save(tmp_path, entry.stem, {"real": real, "imag": wanted[0].imag, "damping": wanted[1]}, "")
    got = again(tmp_path)
    assert got[0].tobytes() == wanted[0].tobytes()
    assert entry.read_bytes() == whole  # mended


def test_a_volume_too_small_for_a_radius_is_no_click() -> None:
    """The least of floating-point volumes, as only a forged log has them."""
    from sonic_bullet.engine.runtime.replay import render_log

    body = replace(ball_body(0.02), volume_m3=5e-324)
    log = ContactLog((body,), (step([[0, 0, 0]]),), (Microphone(np.array([0.0, -1.0, 0.5])),), 8000, 0)
    assert not render_log(log).any()
