"""Cut a recording of several strikes into takes of one each.

recording (channels, n) -> strikes of its loudest channel (onset.py) -> from 50 ms before each to 50 ms before
the next -> a file each
"""

from __future__ import annotations

from collections.abc import Sequence
from pathlib import Path

import numpy as np

from sonic_bullet.apps.report.plots.takes_plot import DrawnRecording, write_takes_picture
from sonic_bullet.files import live_channel, read_audio, write_audio
from sonic_bullet.lab.lines.onset import clipped_samples, is_struck, span
from sonic_bullet.records import Array
from sonic_bullet.records.counts import format_count
from sonic_bullet.records.errors import AudioError


def cut_takes(
    sounds: Sequence[Path], to: Path, force_channel: int | None = None, picture: Path | None = None
) -> tuple[list[Path], list[tuple[str, ...]]]:
    """Cut recordings into takes.

    Parameters
    ----------
    sounds : sequence of Path
        Recordings; one that holds a single strike stays as it is.
    to : Path
        Folder for the takes, `NAME-01.wav` and so on, every channel of them.
    force_channel : int, optional
        Not used to find strikes.
    picture : Path, optional
        .png, .pdf or .svg to draw the recordings to, with where they are cut.

    Returns
    -------
    list of Path
        A file a take, in order.
    list of tuple
        A row a take: its number, place, length, peak, and a note.

    Raises
    ------
    AudioError
        A recording is silent, too short, not finite, or without a hit.
    """
    made: list[Path] = []
    rows: list[tuple[str, ...]] = []
    drawn: list[DrawnRecording] = []

    for path in sounds:
        sound, sr = read_audio(path)
        if force_channel is not None:
            live_channel(sound, force_channel, path)
        others = sound if force_channel is None or len(sound) == 1 else np.delete(sound, force_channel, axis=0)
        live_channel(others, None, path)
        loudest = others[int(np.argmax(np.ptp(others, axis=1)))]
        if not is_struck(loudest, sr):
            raise AudioError(f"no hit found in {path}", "name recordings of impacts, from before each to its decay")
        bounds = take_bounds(loudest, sr)
        drawn += [DrawnRecording(path.name, loudest, sr, bounds)] if picture is not None else []
        for k, (strike, start, stop) in enumerate(bounds, 1):
            piece = path if len(bounds) == 1 else to / f"{path.stem}-{k:02d}.wav"
            if piece is not path:
                write_audio(piece, sound[:, start:stop], sr, full_scale_pa=None)
            made.append(piece)
            rows.append(
                (piece.name, f"{strike / sr:.3f} s", f"{(stop - start) / sr:.3f} s", *_level(loudest[start:stop]))
            )
    if picture is not None:
        write_takes_picture(picture, drawn)
    return made, rows


def take_bounds(signal: Array, sr: int) -> list[tuple[int, int, int]]:
    """Return the samples of each strike of a recording (n,), and of the start and the end of its take."""
    found = span(signal, sr)
    strikes = np.array([found.start, *found.later])
    lead_s = 0.05  # sound kept before a strike, for the noise level; less where the previous strike is nearer
    lead = round(lead_s * sr)
    starts = np.maximum(strikes - lead, 0)
    # the end of a strike whose next one comes within the lead is that strike
    stops = np.append(np.maximum(starts[1:], np.minimum(strikes[:-1] + lead, strikes[1:])), len(signal))
    return [(int(a), int(b), int(c)) for a, b, c in zip(strikes, starts, stops, strict=True)]


def _level(signal: Array) -> tuple[str, str]:
    """Return the peak of a take in dB of full scale, and a note where it is clipped."""
    clipped = clipped_samples(signal)
    peak = 20 * np.log10(max(float(np.abs(signal).max()), 1e-12))
    return f"{peak:.1f} dBFS", f"{format_count(clipped, 'sample')} clipped" if clipped else ""
