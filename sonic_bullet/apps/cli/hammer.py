"""Split recordings with a hammer's force in one channel into sound and force.

take (channels, n) -> NAME-sound.wav, its other channels; NAME-force.wav -> pulse (hammer_pulse.py) -> strike.force and,
where newton at full scale are known and the pulse can be trusted, strike.impulse
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from pathlib import Path

import numpy as np

from sonic_bullet.files import live_channel, read_audio, read_audio_scale, write_audio
from sonic_bullet.lab.lines.hammer_pulse import HammerPulse, measure_pulse
from sonic_bullet.records.errors import AudioError, FileError


@dataclass(frozen=True, slots=True)
class StrikeFiles:
    """Files of a take's sound and force, and its impulse in N·s, None where it is not known."""

    sound: Path
    force: Path
    impulse_n_s: float | None


def part_force(
    takes: Sequence[Path], channel: int, newton: float | None, to: Path
) -> tuple[list[StrikeFiles], list[tuple[str, ...]]]:
    """Split takes into sound and force.

    Parameters
    ----------
    takes : sequence of Path
        Recordings of one strike each.
    channel : int
        Of the force, counted from 0.
    newton : float, optional
        At full scale; None: not known, as is then the impulse.
    to : Path
        Folder for the files made.

    Returns
    -------
    list of StrikeFiles
        One a take, in order.
    list of tuple
        A row a take: its number, force, impulse, peak, length of contact, and a note.

    Raises
    ------
    FileError
        A file lacks that channel, or another one.
    AudioError
        A force or a sound is dead.
    """
    made: list[StrikeFiles] = []
    rows: list[tuple[str, ...]] = []
    for path in takes:
        samples, sr = read_audio(path)
        if len(samples) == 1:
            raise FileError(f"{path} has 1 channel", "--force-channel needs one of force and one of sound at least")
        force, _ = live_channel(samples, channel, path)
        rest = np.delete(samples, channel, axis=0)
        live_channel(rest, None, f"what {path} holds beside its force")
        force = force / (read_audio_scale(path) or 1.0)
        pulse = measure_pulse(force, sr)
        if pulse is None:
            raise AudioError(
                f"channel {channel} of {path} holds no force: nothing stands above its noise",
                "name the hammer's channel, counted from 0, or leave the take out",
            )
        files = to / f"{path.stem}-sound.wav", to / f"{path.stem}-force.wav"
        for file, content in zip(files, (rest, force[None]), strict=True):
            write_audio(file, content, sr, full_scale_pa=None)
        trusted = newton is not None and pulse.hits == 1 and not pulse.flat
        made.append(StrikeFiles(*files, float(f"{pulse.impulse * (newton or 0):.5g}") if trusted else None))
        rows.append((path.name, *_cells(pulse, newton)))
    return made, rows


def _cells(pulse: HammerPulse, newton: float | None) -> tuple[str, ...]:
    scale, unit = (1.0, "of full scale") if newton is None else (newton, "N")
    said = [
        "upside down: turned" * pulse.turned,
        f"saturated, {pulse.flat} samples at its top: impulse not taken" * bool(pulse.flat),
        f"{pulse.hits} hits: impulse not taken" * (pulse.hits > 1),
    ]
    return (
        f"{scale * pulse.impulse:.4g} {'s' if newton is None else 'N·s'}",
        f"{scale * pulse.peak:.4g} {unit}",
        f"{1000 * pulse.contact_s:.3g} ms",
        "; ".join(filter(None, said)),
    )
