"""Where an impact starts in a recording, where the next one interrupts it, and what in it is no honest signal.

energy in blocks of 1 ms -> the first block within 20 dB of the loudest, or the first strike (strike_times.py) ->
first sample above the noise in that block -> about the onset the modes observed after it, run backwards, against
silence: the sample where the sound takes over from silence -> the onset a later strike: another hit; what follows it is
left out
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from sonic_bullet.lab.lines.sinusoids import Sinusoids
from sonic_bullet.lab.lines.strike_times import STRIKE_GAP_S, find_strikes
from sonic_bullet.records import Array
from sonic_bullet.records.counts import format_count

ONSET_BLOCK_S = 1e-3


@dataclass(frozen=True, slots=True)
class Span:
    """Samples from the onset to the end or the next hit; later: those at which hits after the first begin."""

    start: int
    stop: int
    later: tuple[int, ...] = ()

    @property
    def hits(self) -> int:
        """How many onsets there are."""
        return 1 + len(self.later)

    def describe_hits(self, sr: int) -> str:
        """Say how many hits there are, and when; nothing of a single one."""
        shown_hits = 6  # hits whose times are said
        times = [f"{at / sr:.2f}" for at in (self.start, *self.later)][:shown_hits]
        more = ", …" if self.hits > shown_hits else f" and {times.pop()}"
        return f"{self.hits} hits, at {', '.join(times)}{more} s" if self.later else ""


def levels(signal: Array, sr: int) -> tuple[Array, int]:
    """Mean square (b,) in blocks of 1 ms, and the block's length in samples."""
    block = max(1, int(ONSET_BLOCK_S * sr))
    count = len(signal) // block
    return (signal[: count * block].reshape(count, block) ** 2).mean(axis=1), block


def span(signal: Array, sr: int) -> Span:
    """Return the first impact of a recording (n,) that is not silent."""
    near_db = 20.0
    falls = 1.1  # the loudest block of a strike's first 50 ms over those after
    power, block = levels(signal, sr)
    if len(power) < 4:
        return Span(0, len(signal))
    floor = max(float(np.quantile(power, 0.05)), 1e-20)
    strikes = find_strikes(signal, sr)
    early = int(np.argmax(power >= power.max() * 10 ** (-near_db / 10)))  # the first hit, be a later one louder
    struck = round(strikes[0] * sr) // block if len(strikes) else 0
    begun = early + round(STRIKE_GAP_S / ONSET_BLOCK_S)
    if struck > begun and power[early:begun].max() < falls * power[begun:struck].max():
        early = struck  # what was there before does not fall: no strike
    loud = early + int(np.argmax(power[early : early + 10]))
    quiet = np.flatnonzero(power[:loud] < max(1e-3 * power[loud], 4 * floor))
    first = int(quiet[-1]) if len(quiet) else 0
    before = signal[: max(first, 0) * block]
    sigma = float(np.sqrt((before[-50 * block :] ** 2).mean())) if len(before) > block else 0.0
    edge = max(6 * sigma, 0.02 * float(np.abs(signal).max()))
    over = np.flatnonzero(np.abs(signal[first * block :]) > edge)
    start = first * block + (int(over[0]) if len(over) else 0)
    return _until_next(strikes, sr, start, len(signal))


def is_struck(signal: Array, sr: int) -> bool:
    """Say whether a recording (n,) that is not silent holds a hit.

    An onset stands out, or what follows the loudest rise fades, as noise, hum and tones that last do not.
    """
    fades = 2.0
    if len(find_strikes(signal, sr)):
        return True
    x = signal[span(signal, sr).start :]
    half = len(x) // 2
    return bool((x[:half] ** 2).sum() >= fades * (x[half : 2 * half] ** 2).sum())


def until_next_hit(signal: Array, sr: int, start: int) -> Span:
    """Return the impact of a recording (n,) that begins at sample ``start``."""
    return _until_next(find_strikes(signal, sr), sr, start, len(signal))


def _until_next(strikes: Array, sr: int, start: int, end: int) -> Span:
    later = tuple(round(t * sr) for t in strikes[strikes > start / sr + STRIKE_GAP_S])
    return Span(start, later[0] if later else end, later)


def by_modes(signal: Array, start: int, modes: Sinusoids, sr: int, noise: float) -> int:
    """Return the sample at which the modes, of amplitudes at sample ``start``, take over from silence.

    The earliest of the likeliest:

    Σ_{n<t} x² + Σ_{n≥t} (x − m)² is least at the true t; a sine begins with a zero, which silence explains as well:
    hence the earliest within (3 noise)² of the least. Nothing is assumed of the phases.
    """
    reach = 64  # samples that the first guess may be off
    first, last = max(0, start - reach), min(len(signal), start + reach)
    n = np.arange(first, last)
    model = (modes.amplitude * np.exp(modes.pole / sr * (n - start)[:, None])).real.sum(axis=1)
    x = signal[first:last]
    gain = np.concatenate([[0.0], np.cumsum((x - model) ** 2 - x**2)])  # of calling n < t modes too
    cost = gain[-1] - gain
    zero = max(noise, 1e-6 * float(np.sqrt((x**2).mean())))
    return first + int(np.flatnonzero(cost <= cost.min() + 9 * zero**2)[0])


def clipped_samples(signal: Array) -> int:
    """How many samples stand in runs of `clipped_run` and more at the largest magnitude: the recorder's ceiling."""
    clipped_run = 3
    top = np.abs(signal) >= np.abs(signal).max() * (1 - 1e-6)
    edges = np.flatnonzero(np.diff(np.concatenate([[False], top, [False]]).astype(np.int8)))
    run = edges[1::2] - edges[::2]
    return int(run[run >= clipped_run].sum())


def describe_clipping(clipped: int) -> str:
    """Say how many samples are clipped; nothing of none."""
    many = format_count(clipped, "sample is", "samples are")
    return f"{many} clipped: amplitudes and early decays are not to be trusted" if clipped else ""


def describe_doubts(x: Array, sr: int) -> tuple[list[str], bool]:
    """Say what speaks against a recording (n,) from its onset on; whether that is enough not to look for modes."""
    short_s, low_rate, grows_s = 0.1, 30_000, 0.4
    # times its first 50 ms: beyond the one it is said; beyond the other, to which two modes that start against one
    # another do not come, no mode is looked for
    grows, swells = 1.5, 3.0
    notes, hopeless = [], False
    if len(x) < short_s * sr:
        notes.append(
            f"only {1000 * len(x) / sr:.0f} ms of sound: what lies closer than about {sr / len(x):.0f} Hz "
            "may pass for one line"
        )
    if sr < low_rate:
        notes.append(f"{sr} samples a second: nothing above {0.49 * sr:.0f} Hz is seen")
    if len(x) > grows_s * sr:
        level = np.sqrt((x[: len(x) // (sr // 20) * (sr // 20)].reshape(-1, sr // 20) ** 2).mean(axis=1))
        if level[3:].max() > grows * level[0]:
            notes.append(
                f"the sound grows until {np.argmax(level) / 20:.2g} s after its onset: one impact alone does not"
            )
            hopeless = bool(level[3:].max() > swells * level[0])
    return notes, hopeless
