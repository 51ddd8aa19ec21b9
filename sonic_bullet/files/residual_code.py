"""A residual in a preset file: numbers about a sound, no sound.

    modes, lines: f, d, a as lists;
        noise: centres of bands and times, levels in half decibels below the loudest, a byte each, base64

Byte 0 is silence, byte q means ½(q - 255) dB. Levels are of powers per Hz over bands a sixth of an octave wide or
wider, frames that grow with time: no phase, no waveform.
"""

from __future__ import annotations

import base64
import binascii
from typing import Annotated

import msgspec
import numpy as np

from sonic_bullet.records import Array, Residual
from sonic_bullet.records.errors import MaterialError, RecordError
from sonic_bullet.signal.elementary import power as to_power

CODE_STEP_DB = 0.5

Numbers = Annotated[tuple[float, ...], msgspec.Meta(max_length=4096)]


class ResidualForm(msgspec.Struct, frozen=True, forbid_unknown_fields=True, kw_only=True, omit_defaults=True):
    """`Residual` as JSON. source: what it was taken from; loudest_per_hz: the power per Hz of byte 255."""

    source: str
    mode_freq_hz: Numbers
    mode_decay_per_s: Numbers
    mode_amplitude: Numbers
    line_freq_hz: Numbers = ()
    line_decay_per_s: Numbers = ()
    line_amplitude: Numbers = ()
    freq_hz: Numbers
    time_s: Numbers
    loudest_per_hz: Annotated[float, msgspec.Meta(ge=0)]
    levels: str
    clip_energy: Annotated[float, msgspec.Meta(ge=0)]


def form_of(residual: Residual) -> ResidualForm:
    """Encode a residual; `residual_of` returns the same to a quarter of a decibel."""
    loudest = float(residual.power_per_hz.max(initial=0.0))
    with np.errstate(divide="ignore"):
        level = (
            10 * np.log10(residual.power_per_hz / loudest)
            if loudest > 0
            else np.full(residual.power_per_hz.shape, -np.inf)
        )
    level = np.where(np.isfinite(level), level, -1e9)
    byte = np.clip(np.round(255 + level / CODE_STEP_DB), 0, 255).astype(np.uint8)
    parts = {
        f"{part}_{name}": _short(getattr(residual, f"{part}_{name}"))
        for part in ("mode", "line")
        for name in ("freq_hz", "decay_per_s", "amplitude")
    }
    return ResidualForm(
        source=residual.source, **parts, freq_hz=_short(residual.freq_hz), time_s=_short(residual.time_s),
        loudest_per_hz=loudest, levels=base64.b64encode(byte.tobytes()).decode(), clip_energy=residual.clip_energy,
    )  # fmt: skip


def residual_of(form: ResidualForm, where: str = "preset") -> Residual:
    """Decode a residual. Raises MaterialError naming the preset and what is wrong."""
    most_cells = 1 << 17
    shape = (len(form.freq_hz), len(form.time_s))
    try:
        content = base64.b64decode(form.levels, validate=True)
    except (binascii.Error, ValueError) as error:
        raise MaterialError(f"{where}: residual levels are not base64", "take the residual anew") from error
    if len(content) != shape[0] * shape[1] or len(content) > most_cells:
        raise MaterialError(
            f"{where}: residual holds {len(content)} levels for {shape[0]} bands and {shape[1]} times",
            "take the residual anew",
        )
    byte = np.frombuffer(content, np.uint8).reshape(shape).astype(float)
    power = np.where(byte > 0, form.loudest_per_hz * to_power(10.0, CODE_STEP_DB * (byte - 255) / 10), 0.0)
    names = (
        "mode_freq_hz",
        "mode_decay_per_s",
        "mode_amplitude",
        "line_freq_hz",
        "line_decay_per_s",
        "line_amplitude",
        "freq_hz",
        "time_s",
    )
    try:
        return Residual(
            **{name: np.array(getattr(form, name)) for name in names},
            power_per_hz=power,
            clip_energy=form.clip_energy,
            source=form.source,
        )
    except RecordError as error:
        raise MaterialError(f"{where}: {error.what}", error.remedy) from error


def _short(values: Array) -> tuple[float, ...]:
    """Round to nine digits: a part in 1e9 of a frequency is inaudible."""
    return tuple(float(f"{value:.9g}") for value in values)
