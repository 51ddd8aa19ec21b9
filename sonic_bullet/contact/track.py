"""A measured track, played height by height: dh/dt of its slopes by octave at the distance swept, round and round.

    dh/dt = v Σ_j g_j s_j(x mod L)        s_j: slope of the track's waves in octave j   [records.roughness.track_slopes]

Slopes are linear between their places, four a wave of the finest octave. Gains g_j are those of `profile`.
"""
# mypy: disable-error-code="no-untyped-def"

from __future__ import annotations

from sonic_bullet.machine.compiled import njit
from sonic_bullet.records.roughness import OCTAVES


@njit(nogil=True, error_model="numpy")
def sweep_track(swept, speed, x, track, gains, per_sample_s, rate):
    """Add dh/dt of one side of one pair to n samples of ``rate``, in m/s; return the distance swept after them.

    Parameters
    ----------
    swept : distance before
    speed : two, at the step's ends
    x : (n,) fraction of the step
    track : slopes, flat; where its own begin; how many an octave has; their distance in m
    gains : two (OCTAVES,), at the step's ends
    rate : array, and where in it the samples begin
    """
    slopes, at, count, spacing_m = track
    (gain0, gain1), (total, out) = gains, rate
    for i in range(len(x)):
        share = x[i]
        pace = speed[0] + (speed[1] - speed[0]) * share
        swept += pace * per_sample_s
        place = swept / spacing_m
        first = int(place)
        t = place - first
        first %= count
        second = first + 1 if first + 1 < count else 0
        slope = 0.0
        for j in range(OCTAVES):
            gain = gain0[j] + (gain1[j] - gain0[j]) * share
            if gain != 0.0:
                here = at + j * count
                slope += gain * (slopes[here + first] + t * (slopes[here + second] - slopes[here + first]))
        total[out + i] += slope * pace
    return swept
