"""The compiled half of image.py: closed-form spectra of damped sinusoids, summed as waves, pooled, made loud and
compared.

reach -> slots -> frame -> compare, one level at a time; the equations stand in image.py. Sums are reassociated for
    vector code; the order
depends on the arguments' lengths alone, so the same call gives the same bits.
"""

from __future__ import annotations

import numpy as np
from numba import njit

from sonic_bullet.signal.perceptual.image import OUTSIDE

IMAGE_WINDOW = (0.355768, 0.487396, 0.144232, 0.012604)

NODES = 8  # of the loudness table, an octave of power
TABLE_FROM, TABLE_TO = -13, 54  # its powers of two: −39 to 162 dB SPL


@njit(nogil=True, error_model="numpy")
def centre_and_radius(freq_hz, decay_per_s, sr, length):  # type: ignore[no-untyped-def]
    """Of a mode's spectrum, in bins."""
    return freq_hz / sr * length, 6 + 3 * decay_per_s * length / (2 * np.pi * sr)


@njit(nogil=True, error_model="numpy")
def reach(freq_hz, decay_per_s, amplitude, sr, length, floor):  # type: ignore[no-untyped-def]
    """(m, 3) first bin, bin after the last, place of the first among all.

    The main lobe is 8 bins wide, the skirt falls as (decay/offset)³; the last bin each side fades, so that Π does not
    jump as a mode moves. What decays within x⁻¹ of a window is over where the window, ∝ n² at its edges, has hardly
    begun: its peak is below 3/x³ of an undamped mode's.
    """
    reach = np.zeros((len(freq_hz), 3), np.int64)
    room = 0
    for j in range(len(freq_hz)):
        reach[j, 2] = room
        short = decay_per_s[j] * length / sr
        if 0 < abs(freq_hz[j]) < sr / 2 and abs(amplitude[j]) * min(1.0, 3 / short**3) > floor:
            centre, radius = centre_and_radius(freq_hz[j], decay_per_s[j], sr, length)
            reach[j, 0], reach[j, 1] = (
                max(1, int(np.ceil(centre - radius))),
                min(length // 2 + 1, int(np.floor(centre + radius)) + 1),
            )
            room += max(reach[j, 1] - reach[j, 0], 0)
    return reach


@njit(nogil=True)
def slots(reach, band):  # type: ignore[no-untyped-def]
    """Bins that some mode reaches, and each bin's place among them."""
    bins = len(band)
    edge = np.zeros(bins + 1, np.int64)
    for j in range(len(reach)):
        if reach[j, 1] > reach[j, 0]:
            edge[reach[j, 0]] += 1
            edge[reach[j, 1]] -= 1
    slot, used = np.zeros(bins, np.int64), np.zeros(bins, np.int64)
    count, depth = 0, 0
    for k in range(bins):
        depth += edge[k]
        slot[k] = count
        if depth > 0:
            used[count] = k
            count += 1
    return slot, used[:count]


@njit(nogil=True, error_model="numpy")
def frame(freq_hz, decay_per_s, amplitude, reach, sr, late_s, length, hop):  # type: ignore[no-untyped-def]
    """Frame 0 of every mode in closed form: shapes (2, room) real and imaginary, state and turn (m,): its factor, and
    what a hop makes of it.
    """
    modes = len(freq_hz)
    shapes = np.empty((2, reach[-1, 2] + max(reach[-1, 1] - reach[-1, 0], 0)))
    state, turn = np.zeros(modes, np.complex128), np.zeros(modes, np.complex128)
    geometric = np.empty(length // 2 + 7, np.complex128)
    step = np.exp(complex(0.0, -2 * np.pi / length))
    for j in range(modes):
        count, at = reach[j, 1] - reach[j, 0], reach[j, 2]
        if count <= 0:
            continue
        centre, radius = centre_and_radius(freq_hz[j], decay_per_s[j], sr, length)
        rate = complex(-decay_per_s[j], 2 * np.pi * freq_hz[j])
        top = 1 - np.exp(rate / sr * length)
        state[j] = amplitude[j] * np.exp(rate * late_s) * complex(0.0, -0.5)
        turn[j] = np.exp(rate / sr * hop)
        turned = np.exp(rate / sr) * np.exp(complex(0.0, -2 * np.pi * (reach[j, 0] - 3) / length))
        for k in range(count + 6):
            bottom_re, bottom_im = 1 - turned.real, -turned.imag
            geometric[k] = (
                top * complex(bottom_re, -bottom_im) / (bottom_re * bottom_re + bottom_im * bottom_im + 1e-300)
            )
            turned *= step
        for k in range(count):
            value = (
                IMAGE_WINDOW[0] * geometric[k + 3]
                - 0.5 * IMAGE_WINDOW[1] * (geometric[k + 2] + geometric[k + 4])
                + 0.5 * IMAGE_WINDOW[2] * (geometric[k + 1] + geometric[k + 5])
                - 0.5 * IMAGE_WINDOW[3] * (geometric[k] + geometric[k + 6])
            )
            fade = min(1.0, radius - abs(reach[j, 0] + k - centre))
            shapes[0, at + k], shapes[1, at + k] = fade * value.real, fade * value.imag
    return shapes, state, turn


@njit(nogil=True)
def runs_of(used, band):  # type: ignore[no-untyped-def]
    """(r, 3) runs of used bins that feed one triangle: first slot, slot after the last, the lower triangle; those
    outside are left out.
    """
    runs = np.zeros((len(used), 3), np.int64)
    count = 0
    for i in range(len(used)):
        here = band[used[i]]
        if here == OUTSIDE:
            continue
        if count and runs[count - 1, 2] == here:
            runs[count - 1, 1] = i + 1
        else:
            runs[count] = i, i + 1, here
            count += 1
    return runs[:count]


@njit(nogil=True, fastmath={"reassoc", "contract"}, error_model="numpy")
def compare(reach, bins, spirals, floor, level, table, out, weight):  # type: ignore[no-untyped-def]
    """Σ weight·ΔT² of one level: (band, share, scale, loud); bins of `slots`; spirals of `frame`, whose state is used
    up.
    """
    (slot, used), (shapes, state, turn), (band, share, scale, loud) = bins, spirals, level
    frames, bands = loud.shape
    sum_re, sum_im, power = np.zeros(len(used)), np.zeros(len(used)), np.zeros(bands + 2)
    bits = power.view(np.int64)
    runs, upper_share = runs_of(used, band), share[used]
    alive = np.nonzero(reach[:, 1] > reach[:, 0])[0]
    living = len(alive)
    root = np.sqrt(weight)
    total = 0.0
    for m in range(frames):
        sum_re[:] = 0.0
        sum_im[:] = 0.0
        kept = 0
        for i in range(living):
            j = alive[i]
            real, imag = state[j].real, state[j].imag
            if real * real + imag * imag < 0.25 * floor * floor:
                continue
            alive[kept] = j
            kept += 1
            here, count = reach[j, 2], reach[j, 1] - reach[j, 0]
            first = slot[reach[j, 0]]
            into_re, into_im = sum_re[first : first + count], sum_im[first : first + count]
            shape_re, shape_im = shapes[0, here : here + count], shapes[1, here : here + count]
            for k in range(count):
                into_re[k] += real * shape_re[k] - imag * shape_im[k]
                into_im[k] += real * shape_im[k] + imag * shape_re[k]
            state[j] *= turn[j]
        living = kept
        power[:] = 0.0
        if living:
            for r in range(len(runs)):
                whole, upper = 0.0, 0.0
                for i in range(runs[r, 0], runs[r, 1]):
                    value = sum_re[i] * sum_re[i] + sum_im[i] * sum_im[i]
                    whole += value
                    upper += value * upper_share[i]
                power[runs[r, 2] + 1] += (whole - upper) * scale
                power[runs[r, 2] + 2] += upper * scale
        for b in range(bands):
            observed = 0.0
            cell = (bits[b + 1] >> 49) - ((1023 + TABLE_FROM) << 3)
            if cell >= 0:
                cell = min(cell, table.shape[1] - 2)
                x = (bits[b + 1] & ((1 << 49) - 1)) * (1.0 / (1 << 49))
                y0, y1, s0 = table[b, cell, 0], table[b, cell + 1, 0], table[b, cell, 1]
                # the cell after an octave's last is twice as wide, its slope a cell twice as steep
                s1 = table[b, cell + 1, 1] * (0.5 if cell & 7 == 7 else 1.0)
                observed = y0 + x * (s0 + x * (3 * (y1 - y0) - 2 * s0 - s1 + x * (2 * (y0 - y1) + s0 + s1)))
            difference = observed - loud[m, b]
            total += difference * difference
            if len(out):
                out[m * bands + b] = root * difference
    return weight * total
