"""From bodies to microphones through free air: travel time, 1/r, and the direction of a rigid body's push.

    p[c](t) = Σ_b (s_b + K_b n̂·j_b)(t_e) / r,   t_e + r(t_e)/c = t
        [Pierce 1989, sec. 4-3 (monopole), Chadwick, Zheng, James 2012, eq. 9]

s_b: pressure at 1 m (Pa·m) of the body's modes, j_b: jerk of the rigid body, n̂ and r from the body to the microphone
when the sound left (t_e), so a moving body's Doppler shift is exact: 1/(1 + v/c). r is never below the body's radius,
and the travel time never below 8 samples (5.7 cm at 48 kHz), half the interpolation's length. Flat to 0.02 dB up to 18
kHz at 48 kHz. Every sample depends on absolute time alone: any way of cutting the calls gives the same bits
(`path_kernel`). A body moved by hand emits from its old place and its new one, fading over the step: no click and no
chirp. `propagate` works in place: `copy()` a state first to look ahead and come back. b bodies, c microphones, n
samples, t places.
"""

from __future__ import annotations

from dataclasses import dataclass, fields, replace
from typing import Any

import numpy as np

from sonic_bullet.records import Air, Array
from sonic_bullet.records.errors import AudioError
from sonic_bullet.synth import path_kernel

FARTHEST_M = 1000.0
_MARGIN = 64
_SHORTEST = 1024


@dataclass(frozen=True, slots=True, eq=False)
class Path:
    """What does not change: microphone_m (c, 3), and of each body radius_m (b,) and jerk_coefficient (b,)
    (`radiation.jerk_coefficient`).
    """

    sr: int
    air: Air
    microphone_m: Array
    radius_m: Array
    jerk_coefficient: Array


@dataclass(slots=True, eq=False)
class PathState:
    """Sound under way. at: the next sample. A place is a body's present position or one that it was moved away from.

    body (t,), rest_m (t, 3): of each place. main (b,): each body's present place; left (b,): step in which it was last
    moved by hand; leaving (b,): the place it then left. size (t,): samples remembered, a power of two. ring, delays:
    flat histories of all lines (t·c). awake, cursor, last (t·c,): see path_kernel.
    """

    at: int
    body: Array
    rest_m: Array
    main: Array
    left: Array
    leaving: Array
    size: Array
    ring: Array
    delays: Array
    awake: Array
    cursor: Array
    last: Array

    def copy(self) -> PathState:
        """A state of its own: propagating one leaves the other."""
        arrays: dict[str, Any] = {
            field.name: getattr(self, field.name).copy() for field in fields(self) if field.name != "at"
        }
        return PathState(at=self.at, **arrays)


def empty_path(sr: int, air: Air, microphone_m: Array, at: int = 0) -> tuple[Path, PathState]:
    """A path without bodies to microphones (c, 3), and its state at absolute sample ``at``.

    Raises AudioError on a bad rate or place.
    """
    place = np.array(microphone_m, float).reshape(-1, 3)
    if not (0 < sr <= 10_000_000) or not np.isfinite(place).all():
        raise AudioError(
            f"sample rate {sr} and microphones at {place.tolist()}", "give a rate in Hz and finite positions"
        )
    ints, floats = np.zeros(0, np.int64), np.zeros(0)
    state = PathState(
        int(at), ints, np.zeros((0, 3)), ints, ints, ints, ints, floats, floats, np.zeros(0, bool), ints, ints
    )
    return Path(int(sr), air, place, floats, floats), state.copy()


def append_bodies(path: Path, state: PathState, radius_m: Array, jerk_coefficient: Array) -> tuple[Path, PathState]:
    """Path and state with further bodies (k,), (k,); what is under way goes on unchanged. The old pair stays usable."""
    radius, jerk = np.array(radius_m, float).ravel(), np.array(jerk_coefficient, float).ravel()
    if radius.shape != jerk.shape or not (np.isfinite(radius).all() and np.isfinite(jerk).all()):
        raise AudioError(
            "bodies with radii or jerk coefficients that are not finite",
            "give one finite number of each for every body",
        )
    count, known = len(radius), len(path.radius_m)
    grown = replace(
        path,
        radius_m=np.concatenate([path.radius_m, radius]),
        jerk_coefficient=np.concatenate([path.jerk_coefficient, jerk]),
    )
    state = state.copy()
    first = len(state.body)
    _add_places(state, np.arange(known, known + count), len(path.microphone_m))
    state.main = np.concatenate([state.main, np.arange(first, first + count)])
    state.left = np.concatenate([state.left, np.full(count, -1)])
    state.leaving = np.concatenate([state.leaving, np.full(count, -1)])
    return grown, state


def propagate(
    path: Path,
    state: PathState,
    step: int,
    source: Array,
    jerk: Array,
    position0_m: Array,
    position1_m: Array,
    teleported: Array,
    progress: Array,
) -> Array:
    """Pressure (c, n) in Pa at the next n samples. Changes ``state`` in place.

    step ≥ 0: number of the physics step that these samples are (part of). source (b, n) in Pa·m; jerk (b, 3, n) in
    m/s³, world frame. position0_m, position1_m (b, 3): at the step's start and end; progress (n,): where between them
    each sample lies, 0 … 1. teleported (b,): moved by hand, so both places sound and fade over the step. Bodies are
    summed in order. Below 1e-30 Pa: 0. Raises AudioError on wrong shapes, numbers that are not finite, or a sounding
    body more than 1 km from a microphone.
    """
    count, channels = len(path.radius_m), len(path.microphone_m)
    n = len(progress)
    wanted = {
        "source": (source, (count, n)),
        "jerk": (jerk, (count, 3, n)),
        "position0_m": (position0_m, (count, 3)),
        "position1_m": (position1_m, (count, 3)),
        "progress": (progress, (n,)),
    }
    arrays = {}
    for name, (value, shape) in wanted.items():
        arrays[name] = np.ascontiguousarray(value, float)
        if arrays[name].shape != shape or (name not in ("source", "jerk") and not np.isfinite(arrays[name]).all()):
            raise AudioError(f"{name} of shape {arrays[name].shape}", f"give finite numbers of shape {shape}")
    loud = np.zeros(count, bool)
    if not path_kernel.survey(arrays["source"], arrays["jerk"], path.jerk_coefficient, loud):
        raise AudioError("a source or jerk that is not finite", "look for the step whose contacts or loads produced it")
    _begin_fades(state, step, np.asarray(teleported, bool), loud, channels)
    from_m, to_m, fade = _places(state, step, arrays["position0_m"], arrays["position1_m"])
    _make_room(path, state, from_m, to_m, loud)
    out = np.zeros((channels, n))
    lines = state.size.repeat(channels)
    path_kernel.propagate(
        state.at, out, arrays["source"], arrays["jerk"], path.jerk_coefficient, path.radius_m,
        np.argsort(state.body, kind="stable"), state.body, from_m, to_m, fade, arrays["progress"], path.microphone_m,
        path.sr / path.air.sound_speed_m_s, state.ring, _starts(lines + path_kernel.TAPS), state.delays, _starts(lines),
        lines, state.awake, state.cursor, state.last, path_kernel.tap_polynomials(), loud,
    )  # fmt: skip
    state.at += n
    return out


def _starts(sizes: Array) -> Array:
    return np.concatenate([[0], np.cumsum(sizes)])[: len(sizes)].astype(np.int64)


def _awake(state: PathState, channels: int) -> Array:
    """(t,) whether sound of the place is under way to any microphone."""
    return np.asarray(state.awake.reshape(len(state.body), channels).any(axis=1))


def _add_places(state: PathState, body: Array, channels: int) -> None:
    """Further places for the bodies, asleep."""
    count = len(body)
    lines = count * channels
    state.body = np.concatenate([state.body, body]).astype(np.int64)
    state.rest_m = np.concatenate([state.rest_m, np.zeros((count, 3))])
    state.size = np.concatenate([state.size, np.full(count, _SHORTEST)]).astype(np.int64)
    state.ring = np.concatenate([state.ring, np.zeros(lines * (_SHORTEST + path_kernel.TAPS))])
    state.delays = np.concatenate([state.delays, np.zeros(lines * _SHORTEST)])
    state.awake = np.concatenate([state.awake, np.zeros(lines, bool)])
    state.cursor = np.concatenate([state.cursor, np.zeros(lines, np.int64)])
    state.last = np.concatenate([state.last, np.zeros(lines, np.int64)])


def _begin_fades(state: PathState, step: int, teleported: Array, loud: Array, channels: int) -> None:
    """Give each body moved in this step a new place, once, and only if anything of it is observed: silence needs no
    fade.
    """
    awake = _awake(state, channels)
    moved = np.flatnonzero(teleported & (state.left != step) & (loud | awake[state.main]))
    if not len(moved):
        return
    kept = awake.copy()
    kept[state.main] = True
    kept[state.leaving[state.leaving >= 0]] = True
    if not kept.all():
        _drop_places(state, kept, channels)
    first = len(state.body)
    _add_places(state, moved, channels)
    state.leaving[moved] = state.main[moved]
    state.main[moved] = np.arange(first, first + len(moved))
    state.left[moved] = step


def _drop_places(state: PathState, kept: Array, channels: int) -> None:
    lines = np.repeat(kept, channels)
    sizes = state.size.repeat(channels)
    state.ring = state.ring[np.repeat(lines, sizes + path_kernel.TAPS)]
    state.delays = state.delays[np.repeat(lines, sizes)]
    for name in ("awake", "cursor", "last"):
        setattr(state, name, getattr(state, name)[lines])
    for name in ("body", "rest_m", "size"):
        setattr(state, name, getattr(state, name)[kept])
    number = np.cumsum(kept) - 1
    state.main = number[state.main]
    state.leaving = np.where(state.leaving >= 0, number[state.leaving], -1)


def _places(state: PathState, step: int, position0_m: Array, position1_m: Array) -> tuple[Array, Array, Array]:
    """Where each place lies at the step's start and end (t, 3), (t, 3), and how it fades (t,): see
    path_kernel._emit.
    """
    from_m, to_m, fade = state.rest_m.copy(), state.rest_m.copy(), np.full(len(state.body), 2, np.int64)
    from_m[state.main], to_m[state.main], fade[state.main] = position0_m, position1_m, 0
    moved = np.flatnonzero((state.left == step) & (state.leaving >= 0))
    new, old = state.main[moved], state.leaving[moved]
    from_m[new], fade[new] = position1_m[moved], 1
    from_m[old] = to_m[old] = state.rest_m[old] = position0_m[moved]
    fade[old] = -1
    return from_m, to_m, fade


def _make_room(path: Path, state: PathState, from_m: Array, to_m: Array, loud: Array) -> None:
    """Lengthen the histories of places from which sound needs more time than they remember."""
    channels = len(path.microphone_m)
    if not channels or not len(state.body):
        return
    observed = loud[state.body] | _awake(state, channels)
    away = np.zeros(len(state.body))
    path_kernel.farthest(from_m, to_m, path.microphone_m, away)
    away *= observed
    need = away * (path.sr / path.air.sound_speed_m_s) + _MARGIN
    if not ((need > state.size) | (away > FARTHEST_M)).any():
        return
    far = np.flatnonzero(away > FARTHEST_M)
    if len(far):
        raise AudioError(
            f"body {state.body[far[0]]} sounds {away[far[0]]:.0f} m from a microphone",
            f"keep what sounds within {FARTHEST_M:.0f} m, or remove it",
        )
    size = np.maximum(state.size, 2 ** np.ceil(np.log2(need)).astype(np.int64))
    lines, new_lines = state.size.repeat(channels), size.repeat(channels)
    ring, delays = np.zeros(int((new_lines + path_kernel.TAPS).sum())), np.zeros(int(new_lines.sum()))
    froms, tos = _starts(lines + path_kernel.TAPS), _starts(new_lines + path_kernel.TAPS)
    froms_d, tos_d = _starts(lines), _starts(new_lines)
    for line, (old, new) in enumerate(zip(lines, new_lines, strict=True)):
        sample = np.arange(state.at - old, state.at)
        ring[tos[line] + sample % new] = state.ring[froms[line] + sample % old]
        ring[tos[line] + new : tos[line] + new + path_kernel.TAPS] = ring[tos[line] : tos[line] + path_kernel.TAPS]
        delays[tos_d[line] + sample % new] = state.delays[froms_d[line] + sample % old]
    state.ring, state.delays, state.size = ring, delays, size
