"""Is the slope of a decay's first straight piece nearer to the T60 ratios that another script measured?

    python -m studies.first_decay --data ../shared/states

Level of an octave over time -> one slope from the first to the last level, −5 and −25 dB as ISO 3382-1 and
`octave_values.py` have it, or others; or, as far as −25 or −40 dB, two lines that meet,

    L(t) = L₀ − a min(t, t_b) − b max(t − t_b, 0),   b < a/2,   a t_b ≥ 10 dB,   N ln(S₁/S₂) > 2 ln N           (1)

of which the first is the decay; where (1) does not hold, one slope. S: squares left by one and by two lines, N: how
many values are free of each other under the smoothing. Medians over takes; right is within 15 % of a set's README.
"""

from __future__ import annotations

import argparse
from pathlib import Path

import numpy as np

from benchmarks.real_states import OCTAVES_HZ, PAIRS, WITHIN, t60_ratios
from sonic_bullet.lab.states.octave_values import noise_of, octave_energies
from sonic_bullet.lab.states.recorded_states import read_states
from sonic_bullet.records import Array

LEAST_DB = 10.0


def smoothed_db(power: Array, block_s: float, middle_hz: float) -> tuple[Array, float, int]:
    """Return the level (m,) from its loudest on, what the noise lets see of it, and how many blocks were smoothed."""
    width = max(1, round(max(0.004, 2 / middle_hz) / block_s))
    smooth = np.convolve(power, np.ones(width) / width, "valid")
    start = int(np.argmax(smooth[: max(1, round(0.1 / block_s))]))
    level = 10 * np.log10(np.maximum(smooth[start:], 1e-30) / smooth[start])
    return level, float(10 * np.log10(4 * noise_of(power, block_s) / smooth[start])), width


def decay_s(
    power: Array, block_s: float, middle_hz: float, between: tuple[float, float], bend_db: float = 0.0
) -> float:
    """Return the T60 between two levels, of the first piece where a bend above bend_db is told; NaN of too little."""
    level, seen_db, width = smoothed_db(power, block_s, middle_hz)
    begun = np.flatnonzero(level <= between[0])
    if not len(begun) or between[0] - max(between[1], seen_db) < LEAST_DB:
        return float("nan")

    def part(low_db: float) -> tuple[Array, Array]:
        below = np.flatnonzero(level < max(low_db, seen_db))
        piece = level[begun[0] : below[0] if len(below) else len(level)]
        return np.arange(len(piece)) * block_s, piece

    time, piece = part(between[1])
    if len(piece) < 4 or piece[0] - piece.min() < 0.7 * LEAST_DB:
        return float("nan")
    if bend_db:
        t, x = part(bend_db)
        one = float(((x - np.polyval(np.polyfit(t, x, 1), t)) ** 2).sum())
        best = (np.inf, 0.0, 0.0, 0.0)
        for at in t[2:-2]:
            basis = np.stack([np.ones_like(t), np.minimum(t, at), np.maximum(t - at, 0)], axis=1)
            solved = np.linalg.lstsq(basis, x, rcond=None)[0]
            best = min(best, (float(((x - basis @ solved) ** 2).sum()), float(at), float(solved[1]), float(solved[2])))
        left, at, first, second = best
        free = max(len(x) / width, 2.0)
        bent = first < 0 and second > first / 2 and -first * at >= LEAST_DB
        if bent and free * np.log(one / max(left, 1e-9)) > 2 * np.log(free):
            return -60 / first
    return float(-60 / np.polyfit(time, piece, 1)[0])


def main() -> None:
    """Print how many octaves of each pair are right, by one slope and by first pieces."""
    parser = argparse.ArgumentParser(description=(__doc__ or "").splitlines()[0])
    parser.add_argument("--data", type=Path, required=True)
    data = parser.parse_args().data
    ways = [((-5.0, low), 0.0) for low in (-15.0, -20.0, -25.0, -35.0)]
    ways += [((high, -25.0), bend) for high in (-5.0, 0.0) for bend in (-25.0, -40.0)]
    right = np.zeros((len(ways), 2), int)
    for pair in PAIRS:
        known = t60_ratios(data / pair.place, pair)
        if not pair.of_the_thing or not known:
            continue
        states = read_states([data / pair.place / name for name in (pair.before, pair.after)])
        bands = [[octave_energies(take.signal, s.sr, np.array(OCTAVES_HZ)) for take in s.takes] for s in states]
        print(f"{pair.place}, {pair.after}: {known}")
        for k, way in enumerate(ways):
            t60 = [
                np.array([[decay_s(*one, f, *way) for one, f in zip(take, OCTAVES_HZ, strict=True)] for take in state])
                for state in bands
            ]
            ratio = dict(zip(OCTAVES_HZ, np.nanmedian(t60[1], axis=0) / np.nanmedian(t60[0], axis=0), strict=True))
            near = sum(abs(np.log(ratio[f] / true)) <= np.log(1 + WITHIN) for f, true in known.items())
            right[k] += near, len(known)
            print(f"  {way}: {near} of {len(known)}: {', '.join(f'{f:g} Hz {ratio[f]:.2f}' for f in known)}")
    for way, (near, of) in zip(ways, right, strict=True):
        print(f"{way}: {near} of {of}")


if __name__ == "__main__":
    main()
