"""Picture of a render: pressure and spectrum above, contacts below, on one time axis.

    samples (channels, n) Pa -> pressure p(t)
                             -> level of a short-time spectrum, dB re 20 µPa per bin: 20 log10(|P(f, t)|/√2/20 µPa), |P|
                                 the amplitude of a sine
    SoundEvent (soundtrack)  -> per body one lane: strikes (area ∝ impulse), sliding and rolling bars

Events are those of the table that `--events` writes, and supports beside them.
"""

from __future__ import annotations

import os
from collections.abc import Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import numpy as np

from sonic_bullet.engine.runtime.sound_events import SoundEvent, find_sound_events
from sonic_bullet.files import check_output, check_sr, replace_file
from sonic_bullet.files.contact_log import ContactLog
from sonic_bullet.files.levels import as_sound
from sonic_bullet.files.storage.spooled_sound import READ_FRAMES, KeptSound
from sonic_bullet.records import Array, ContactMicrophone, Microphone, Sensor, Vibrometer
from sonic_bullet.records.errors import AudioError, FileError
from sonic_bullet.records.units import REFERENCE_PRESSURE_PA

LANES_MAX = 24


@dataclass(frozen=True, slots=True, eq=False)
class Events:
    """Events of a log's bodies.

    strike_* (s,): body index, time in s, impulse in N·s; bar_* (r,): body index, start, end in s, kind.
    """

    strike_body: Array
    strike_s: Array
    strike_n_s: Array
    bar_body: Array
    bar_s: Array
    bar_kind: tuple[str, ...]


def drawn_events(log: ContactLog, events: Sequence[SoundEvent]) -> Events:
    """Collect the strikes and the bars of rest, rolling or sliding of every body that has a model."""
    verbs = {"support": "rests", "roll": "rolls", "slide": "slides"}  # of what lasts
    strikes: list[tuple[int, float, float]] = []
    bars: list[tuple[int, float, float, str]] = []
    for one in events:
        bodies = [i for i in (one.low, one.high) if log.bodies[i].model is not None]
        if one.kind == "impact":
            strikes += [(body, one.start_s, one.impulse_n_s) for body in bodies]
        elif one.kind in verbs:
            bars += [(body, one.start_s, one.end_s, verbs[one.kind]) for body in bodies]
    return Events(
        np.array([s[0] for s in strikes], int),
        np.array([s[1] for s in strikes], float),
        np.array([s[2] for s in strikes], float),
        np.array([r[0] for r in bars], int),
        np.array([r[1:3] for r in bars], float).reshape(-1, 2),
        tuple(r[3] for r in bars),
    )


def spectrogram_db(samples: Array | KeptSound, sr: int) -> tuple[Array, Array, Array]:
    """Compute the spectrogram of the first channel of (channels, n) or (n,) pascals; stored sound is read by windows.

    Returns frequencies (f,) Hz, times (t,) s, levels (f, t) dB re 20 µPa. A Hann window of 10 ms, scaled so that a sine
    of amplitude a reads 20 log10(a/√2/20 µPa) whatever the rate.
    """
    columns_max = 1600
    window_s = 0.010
    from scipy.signal.windows import hann

    sound = as_sound(samples)
    size, frames = max(16, round(window_s * sr)), sound.shape[1]
    hop = max(size // 4, int(np.ceil(frames / columns_max)))
    window, length = hann(size, sym=False), 2 ** int(np.ceil(np.log2(size)) + 1)
    middle = np.arange(0, frames + hop, hop)
    amplitude = np.zeros((length // 2 + 1, len(middle)))
    for column, at in enumerate((middle - size // 2).tolist()):
        cut, early = np.zeros(size), max(-at, 0)
        found = sound.read(at + early, at + size)[0]
        cut[early : early + len(found)] = found
        amplitude[:, column] = 2 * np.abs(np.fft.rfft(cut * window, length)) / window.sum()
    with np.errstate(divide="ignore"):
        level = 20 * np.log10(amplitude / np.sqrt(2) / REFERENCE_PRESSURE_PA)
    return np.fft.rfftfreq(length, 1 / sr), middle / sr, level


def quantity(sensor: Sensor) -> tuple[str, str]:
    """Return the quantity of a sensor's samples, and their unit."""
    if isinstance(sensor, Microphone):
        return "pressure", "Pa"
    if isinstance(sensor, ContactMicrophone):
        return "acceleration", "m/s²"
    return ("velocity", "m/s") if isinstance(sensor, Vibrometer) else ("modal sum", "1")


def check_picture_output(path: str | os.PathLike[str]) -> Path:
    """Check a picture's path; return the real one.

    Raises FileError where the extension is not .png, .pdf or .svg or the place cannot be written.
    """
    extensions = (".png", ".pdf", ".svg")
    if Path(path).suffix.lower() not in extensions:
        raise FileError(
            f"cannot draw {path}: unknown picture format", f"end the name with one of {' '.join(extensions)}"
        )
    return check_output(path)


def render_picture(
    path: str | os.PathLike[str],
    samples: Array | KeptSound,
    sr: int,
    log: ContactLog | None = None,
    title: str = "",
    events: Sequence[SoundEvent] | None = None,
) -> None:
    """Draw ``samples`` (channels, n) in Pa, and the events of ``log`` where there is one, to a PNG, PDF or SVG.

    Of several channels the first is drawn, and the picture says so. Equal input gives equal bytes.

    Parameters
    ----------
    events
        The log's, where they are known already; None: they are found (`find_sound_events`).

    Raises
    ------
    FileError
        The place or the extension is wrong.
    AudioError
        The rate, the shape or the samples are wrong.
    """
    check_picture_output(path)
    rate = check_sr(sr)
    sound = as_sound(samples)
    if np.ndim(samples) == 1 or sound.shape[0] == 0 or not np.isfinite(sound.peaks()).all():  # type: ignore[arg-type]
        raise AudioError(
            f"samples of shape {sound.shape} cannot be drawn", "pass finite samples of shape (channels, n)"
        )
    from matplotlib.backends.backend_agg import FigureCanvasAgg
    from matplotlib.figure import Figure

    shown = None
    if log is not None:
        shown = drawn_events(log, events if events is not None else find_sound_events(log, sr=rate))
    lanes = [] if log is None or shown is None else _lanes(log, shown)
    heights = [1.6, 3.2] + ([0.45 + 0.24 * len(lanes)] if shown is not None else [])
    figure = Figure(figsize=(12, sum(heights) + 1.2), dpi=120, layout="constrained")
    FigureCanvasAgg(figure)
    axes = figure.subplots(len(heights), 1, sharex=True, height_ratios=heights)
    what, unit = quantity(log.sensors[0]) if log is not None and log.sensors else ("pressure", "Pa")
    _draw_samples(axes[0], sound, rate, what, unit)
    image = _draw_spectrogram(axes[1], sound, rate)
    if image is not None:
        figure.colorbar(
            image,
            ax=axes[1],
            label="dB re 20 µPa" if unit == "Pa" else f"dB re 20·10⁻⁶ {unit}",
            pad=0.01,
            fraction=0.03,
        )
    if log is not None and shown is not None:
        _draw_events(axes[2], log, shown, lanes)
    axes[-1].set_xlabel("time in s")
    axes[-1].set_xlim(0, max(sound.shape[1] / rate, log.duration_s if log is not None else 0, 1e-3))
    observed = f"channel 1 of {sound.shape[0]}" if sound.shape[0] > 1 else ""
    figure.suptitle(" · ".join(part for part in (title.replace("$", r"\$"), observed) if part), fontsize=11)
    extension = Path(path).suffix.lower()[1:]
    timeless = {"png": {"Software": None}, "pdf": {"CreationDate": None}, "svg": {"Date": None}}[extension]
    with replace_file(path) as file:
        figure.savefig(file, format=extension, metadata=timeless)


def _draw_samples(axis: Any, sound: KeptSound, sr: int, what: str, unit: str) -> None:
    """Draw p(t) as the band between least and greatest value of at most 4000 stretches, so that no peak is lost."""
    frames = sound.shape[1]
    stretch = max(1, frames // 4000)
    least, most, energy = [np.zeros(0)], [np.zeros(0)], 0.0
    for block in sound.blocks(stretch * max(1, READ_FRAMES // stretch)):  # of whole stretches, but the last
        energy += float(np.sum(block[0] ** 2))
        whole = block[0, : block.shape[1] // stretch * stretch].reshape(-1, stretch)
        least.append(whole.min(1, initial=np.inf))
        most.append(whole.max(1, initial=-np.inf))
    low, high = np.concatenate(least), np.concatenate(most)
    if len(low):
        time_s = np.arange(len(low)) * stretch / sr
        axis.fill_between(time_s, low, high, color="#1f4e79", linewidth=0.4, edgecolor="#1f4e79")
    peak = float(max(-low.min(initial=0.0), high.max(initial=0.0)))
    if peak > 0:
        rms = float(np.sqrt(energy / frames))
        level = f", mean level {20 * np.log10(max(rms, 1e-300) / REFERENCE_PRESSURE_PA):.0f} dB" if unit == "Pa" else ""
        axis.set_title(f"peak {peak:.3g} {unit}{level}", loc="right", fontsize=8)
    else:
        axis.set_title("silence", loc="right", fontsize=8)
    axis.set_ylabel(f"{what} in {unit}")
    axis.grid(alpha=0.25)


def _draw_spectrogram(axis: Any, sound: KeptSound, sr: int) -> Any:
    dynamics_db = 90.0
    frequency, time_s, level = spectrogram_db(sound, sr)
    shown = frequency <= 20_000
    frequency, level = frequency[shown], level[shown]
    loudest = float(level.max(initial=-np.inf))
    axis.set_ylabel("frequency in kHz")
    axis.set_ylim(0, min(20.0, sr / 2000))
    if not np.isfinite(loudest):
        axis.text(0.5, 0.5, "silence", transform=axis.transAxes, ha="center", color="#777777")
        return None
    floor = loudest - dynamics_db
    image = axis.imshow(
        np.maximum(level, floor),
        origin="lower",
        aspect="auto",
        interpolation="nearest",
        cmap="magma",
        vmin=floor,
        vmax=loudest,
        extent=(time_s[0], time_s[-1] + (time_s[-1] - time_s[0]) / max(1, len(time_s) - 1), 0, frequency[-1] / 1000),
    )
    return image


def _lanes(log: ContactLog, events: Events) -> list[int]:
    """Choose the bodies to show: those with events, the busiest where there are too many, in the log's order."""
    busy = np.bincount(np.append(events.strike_body, events.bar_body), minlength=len(log.bodies))
    chosen = np.argsort(-busy, kind="stable")[:LANES_MAX]
    return sorted(int(i) for i in chosen if busy[i] > 0)


def _draw_events(axis: Any, log: ContactLog, events: Events, lanes: list[int]) -> None:
    strikes_max = 400  # of a lane, the strongest
    from matplotlib import colormaps
    from matplotlib.lines import Line2D

    colours, looks = (
        colormaps["tab10"](np.arange(10)),
        {"rests": (0.8, 0.25), "rolls": (3.0, 0.6), "slides": (6.0, 0.9)},
    )
    largest = float(events.strike_n_s.max(initial=0))
    for lane, body in enumerate(lanes):
        colour = colours[lane % len(colours)]
        for kind, (width, alpha) in looks.items():
            spans = [
                span
                for span, owner, which in zip(events.bar_s, events.bar_body, events.bar_kind, strict=True)
                if owner == body and which == kind
            ]
            axis.hlines(
                [lane] * len(spans),
                [s[0] for s in spans],
                [s[1] for s in spans],
                colors=[colour],
                linewidth=width,
                alpha=alpha,
            )
        mine = np.flatnonzero(events.strike_body == body)
        mine = mine[np.argsort(-events.strike_n_s[mine], kind="stable")[:strikes_max]]
        axis.scatter(
            events.strike_s[mine],
            np.full(len(mine), lane),
            s=4 + 140 * events.strike_n_s[mine] / max(largest, 1e-300),
            color=[colour],
            marker="|",
            linewidths=1.4,
            zorder=3,
        )
        axis.scatter(
            events.strike_s[mine],
            np.full(len(mine), lane),
            s=140 * events.strike_n_s[mine] / max(largest, 1e-300),
            facecolors="none",
            edgecolors=[colour],
            linewidths=0.9,
            zorder=3,
        )
    axis.set_yticks(range(len(lanes)), [_label(log, body) for body in lanes], fontsize=8)
    axis.set_ylim(len(lanes) - 0.4, -0.6)
    axis.grid(axis="x", alpha=0.25)
    if not lanes:
        axis.set_ylim(1, -1)
        axis.text(0.5, 0.5, "no contacts", transform=axis.transAxes, ha="center", va="center", color="#777777")
        return
    handles = [
        Line2D([], [], color="#444444", linewidth=width, alpha=alpha, label=kind)
        for kind, (width, alpha) in looks.items()
    ]
    if largest > 0:
        handles.append(
            Line2D(
                [],
                [],
                color="#444444",
                marker="o",
                markerfacecolor="none",
                markersize=11,
                linestyle="",
                label=f"strike of {largest:.2g} N·s",
            )
        )
    axis.legend(
        handles=handles, loc="lower right", bbox_to_anchor=(1.0, 1.0), borderpad=0.1, ncols=4, fontsize=7, frameon=False
    )


def _label(log: ContactLog, index: int) -> str:
    """Format name and material of a body as a lane's label."""
    body = log.bodies[index]
    name = body.name if len(body.name) <= 18 else body.name[:17] + "…"
    name = name.encode("utf-8", "replace").decode().replace("$", r"\$")
    return f"{name} ({body.material.name})" if body.material is not None else name
