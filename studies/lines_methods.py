"""Lines of real takes by several methods, played again beside the takes themselves.

    python studies/lines_methods.py --data ../shared/measured [--methods sonic-bullet,peaks,lscf] [--sets NAME ...]

distance   of a take and of what its lines play with a noise like the take's own, from 20 ms after the onset
           (`signal.log_spectral`, the first recorded second)
too loud   dB by which a line, or the lines closer than a window tells apart, stands above what was recorded in its
           band, over max(50 ms, 5 cycles), where that stands 10 dB over the noise: the worst of all
"""

from __future__ import annotations

import argparse
import time
from collections.abc import Callable, Iterator
from pathlib import Path

import numpy as np

from sonic_bullet.files import read_audio
from sonic_bullet.lab.fit.recorded import onset_sample
from sonic_bullet.records import Array
from sonic_bullet.signal.log_spectral import Floor, floor_between, log_spectral_db, with_noise

LATE_S, SECONDS = 0.02, 2.0
Found = tuple[Array, Array]  # pole (k,) in 1/s, amplitude (k,) complex at the onset
HITS = ("wood-iet-timbr/dev/170620_G5_Flex", "diffimpact-hammer/dev/ceramic", "diffimpact-hammer/dev/wood")
TAKES = (
    "agogo-forzee/dev/AgogoHigh-2",
    "agogo-forzee/dev/AgogoHigh-4",
    "bell-sonicpi/dev",
    "diffimpact-robot/dev/steel-fork-ceramic-mug/1623447184344_74",
    "diffimpact-robot/dev/wood-spoon-ceramic-mug/1623459615544_45",
    "diffimpact-robot/dev/steel-fork-wood-holder/1623446489540_60",
    "diffsound-bowl/mic0",
    "diffsound-bowl/mic5",
    "glockenspiel-fluidr3/dev/glocken_C8",
    "pyrfda-steel-bar/dev",
    "realimpact-clips",
    "ride-bja/dev/BL_01",
    "ride-bja/dev/RD_03",
    "xylophone-vcsl/dev/C4",
    "xylophone-vcsl/dev/C6",
)


def takes(data: Path, wanted: list[str]) -> Iterator[tuple[str, Array, int]]:
    """Name, samples (n,) from the onset on, rate of takes of all sets; of long files the second and the fifth hit."""
    import json

    for name in HITS + TAKES:
        if wanted and not any(w in name for w in wanted):
            continue
        for path in sorted(data.glob(f"{name}*.flac")) or sorted(data.glob(f"{name}/*.flac")):
            sound, sr = read_audio(path)
            x = sound[0]
            if name in HITS:
                case = json.loads((data / name.split("/")[0] / "case.json").read_text())
                hits = next(f["hits"] for f in case["files"] if f["file"].endswith(path.name))
                at = [h.get("t_hit_s", h.get("t_s", h.get("time_s"))) for h in hits]
                for k in (1, 4):
                    if k < len(at):
                        end = at[k + 1] if k + 1 < len(at) else len(x) / sr
                        part = x[int((at[k] - 0.02) * sr) : int((end - 0.02) * sr)]
                        yield f"{name.split('/')[0]}:{path.stem}#{k}", part[onset_sample(part, sr) :], sr
            else:
                yield f"{name.split('/')[0]}:{path.stem}", x[onset_sample(x, sr) :], sr


def played(pole: Array, amplitude: Array, count: int, sr: int) -> Array:
    """Re Σ A e^{pt} (n,)."""
    t, x = np.arange(count) / sr, np.zeros(count)
    for p, a in zip(pole, amplitude, strict=True):
        x += np.real(a * np.exp(np.maximum(p.real * t, -80) + 1j * p.imag * t))
    return x


def too_loud_db(x: Array, found: Found, floor: Floor, sr: int) -> tuple[float, float]:
    """The worst excess in dB of a group of lines over what was recorded in its band, and the group's frequency."""
    pole, amplitude = found
    order = np.argsort(pole.imag)
    pole, amplitude = pole[order], amplitude[order]
    freq = pole.imag / 2 / np.pi
    worst = (-np.inf, np.nan)
    for length_s in (0.05, 0.1, 0.25):
        n = int(length_s * sr)
        inside = (freq >= 5 / length_s) & ((freq < 10 / length_s) if length_s > 0.05 else True)
        if not inside.any() or n > len(x):
            continue
        shape, gap = np.hanning(n), 3 / length_s
        density = floor.at(n // 2 + 1) * (shape**2).sum()
        starts = range(0, len(x) - n + 1, n // 2)
        recorded = np.array([np.abs(np.fft.rfft(x[s : s + n] * shape)) ** 2 for s in starts])
        p, a = pole[inside], amplitude[inside]
        for group in np.split(np.arange(len(p)), np.flatnonzero(np.diff(p.imag) / 2 / np.pi > gap) + 1):
            half = 2 / length_s + -p[group].real.min() / np.pi
            low, high = p[group].imag.min() / 2 / np.pi - half, p[group].imag.max() / 2 / np.pi + half
            cells = slice(max(0, int(low * length_s)), int(high * length_s) + 2)
            made = played(p[group], a[group], len(x), sr)
            mine = np.array([np.sum(np.abs(np.fft.rfft(made[s : s + n] * shape))[cells] ** 2) for s in starts])
            there, noise = recorded[:, cells].sum(axis=1), density[cells].sum()
            over = 10 * np.log10(np.maximum(mine, 1e-30) / there)[there > 10 * noise]
            if len(over) and over.max() > worst[0]:
                worst = float(over.max()), float(p[group].imag.mean() / 2 / np.pi)
    return worst


def by_sonic_bullet(x: Array, sr: int) -> Found:
    """The package's own."""
    from sonic_bullet.lab.lines.joint_lines import joint_lines

    lines = joint_lines(x[None], sr, band_hz=(20.0, min(20_000.0, 0.48 * sr)))
    return lines.pole, lines.amplitude[0]


def by_peaks(x: Array, sr: int, seconds: float = 1.0) -> Found:
    """Peaks of a spectrum of some seconds from LATE_S on that stand 20 dB above their neighbourhood; decay by the
    level's slope.
    """
    from scipy.ndimage import median_filter

    start = int(LATE_S * sr)
    y = x[start : start + sr]
    n = 2048 if sr < 30_000 else 4096
    frames = np.lib.stride_tricks.sliding_window_view(y, n)[:: n // 4]
    level = np.abs(np.fft.rfft(frames * np.hanning(n), axis=1)) ** 2
    early = y[: round(seconds * sr)]
    spectrum = np.abs(np.fft.rfft(early * np.hanning(len(early)))) ** 2
    broad = median_filter(spectrum, max(31, round(201 * min(seconds, 1.0)) | 1))
    peak = np.flatnonzero(
        (spectrum[1:-1] > 100 * broad[1:-1]) & (spectrum[1:-1] >= spectrum[:-2]) & (spectrum[1:-1] > spectrum[2:])
    )
    poles: list[complex] = []
    for k in peak[np.argsort(-spectrum[peak + 1])][:40] + 1:
        f = k * sr / len(early)
        if f < 20 or f > 20_000 or any(abs(p.imag / 2 / np.pi - f) < sr / n for p in poles):
            continue
        course = 10 * np.log10(level[:, round(f * n / sr)] + 1e-30)
        alive = course > course[-len(course) // 4 :].mean() + 10
        last = int(np.argmin(alive)) if not alive.all() else len(alive)
        if last >= 4:
            slope = np.polyfit(np.arange(last) * (n // 4) / sr, course[:last], 1)[0]
            if slope < 0:
                poles.append(slope / 8.686 + 2j * np.pi * f)
    return _amplitudes(y, np.array(poles, complex), sr, start)


def by_lscf(x: Array, sr: int) -> Found:
    """Poles of sdypy-EMA's LSCF, band by band of 2 kHz, those that stay from order 20 to order 30."""
    from sdypy import EMA  # type: ignore[import-not-found]

    start = int(LATE_S * sr)
    y = x[start : start + sr]
    poles: list[complex] = []
    n = 1 << int(np.log2(len(y)))
    spectrum, freq = np.fft.rfft(y[:n]), np.arange(n // 2 + 1) * sr / n
    for low in np.arange(20, min(20_000, 0.45 * sr), 2000):
        model = EMA.Model(spectrum[None], freq, lower=low, upper=low + 2000, pol_order_high=30)
        model.get_poles(show_progress=False)
        last, before = model.all_poles[-1], model.all_poles[-10]
        poles += [
            p
            for p in last
            if p.imag > 2 * np.pi * low and p.real < 0 and np.abs(before - p).min() < 0.05 * abs(p.real) + 1
        ]
    return _amplitudes(y, np.array(poles, complex), sr, start)


def _amplitudes(y: Array, pole: Array, sr: int, start: int) -> Found:
    if not len(pole):
        return pole, pole
    t = np.arange(len(y)) / sr
    ring = np.exp(np.outer(t, pole))
    answer = np.linalg.lstsq(np.concatenate([ring.real, -ring.imag], axis=1), y, rcond=1e-8)[0]
    k = len(pole)
    return pole, (answer[:k] + 1j * answer[k:]) * np.exp(-pole * start / sr)


METHODS: dict[str, Callable[[Array, int], Found]] = {
    "sonic-bullet": by_sonic_bullet,
    "peaks": by_peaks,
    "lscf": by_lscf,
}


def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0] if __doc__ else "")
    parser.add_argument("--data", type=Path, required=True)
    parser.add_argument("--methods", default="sonic-bullet,peaks")
    parser.add_argument("--sets", nargs="*", default=[])
    asked = parser.parse_args()
    methods = asked.methods.split(",")
    print(f"| take | silence dB | {' | '.join(f'{m}: lines, dB, too loud dB, s' for m in methods)} |")
    print("|---" * (2 + len(methods)) + "|")
    gathered: dict[str, list[tuple[float, float, float]]] = {m: [] for m in methods}
    for name, whole, sr in takes(asked.data, asked.sets):
        x = whole[: int(SECONDS * sr)]
        late, end = int(LATE_S * sr), int(1.0 * sr)
        floor = floor_between([x])
        silence = log_spectral_db(x[late:end], with_noise(np.zeros(len(x[late:end])), floor, 1), floor)
        cells = []
        for method in methods:
            begun = time.process_time()
            try:
                pole, amplitude = METHODS[method](x, sr)
            except Exception as error:
                cells.append(f"{type(error).__name__}: {error}")
                continue
            spent = time.process_time() - begun
            made = played(pole, amplitude, len(x), sr)
            off = log_spectral_db(x[late:end], with_noise(made[late:end], floor, 1), floor)
            loud, at = too_loud_db(x, (pole, amplitude), floor, sr)
            gathered[method].append((off, loud, spent))
            cells.append(f"{len(pole)}, {off:.1f}, {loud:.1f} ({at:.0f} Hz), {spent:.1f}")
        print(f"| {name} | {silence:.1f} | {' | '.join(cells)} |", flush=True)
    for method, rows in gathered.items():
        off, loud, spent = np.array(rows).T
        print(
            f"{method}: distance median {np.median(off):.2f}, worst {off.max():.1f} dB; "
            f"too loud in {int((loud > 1).sum())} of {len(loud)}, worst {loud.max():.1f} dB; "
            f"processor median {np.median(spent):.1f}, most {spent.max():.1f} s"
        )


if __name__ == "__main__":
    main()
