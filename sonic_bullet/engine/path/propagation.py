"""Sound path from bodies to microphones in free air: travel time, 1/r, and the direction of rigid-body pressure.

    p[c](t) = Σ_b (s_b + n̂·j_b)(t_e) / r,   t_e + r(t_e)/c = t
        [Pierce 1989, sec. 4-3 (monopole), Chadwick, Zheng, James 2012, eq. 9]

s_b: pressure at 1 m (Pa·m) of the body's modes, j_b: that of the rigid body along each axis (Pa·m; K times its jerk),
n̂ and r from the body to the microphone when the sound left (t_e), so a moving body's Doppler shift is exact: 1/(1 +
v/c). r is never below the body's radius, and the travel time never below 12 samples (8.6 cm at 48 kHz), half the
interpolation's length. Flat to 0.02 dB up to 18 kHz at 48 kHz. Every sample depends on absolute time alone: any split
into calls gives the same bits. A teleported body emits from its old place and its new one, crossfaded over the step: no
click and no chirp.

The engine's `hear` (src/path/sound_path.hpp) does the work on the state's tables; this module makes and lengthens them.
b bodies, c microphones, n samples, t places.
"""

from __future__ import annotations

from dataclasses import dataclass, fields
from typing import Any

import numpy as np

from sonic_bullet._engine import FARTHEST_M, LINE, MEMORY_SHORT, MIRRORED, PLACE, PLACES_SHORT, SOURCE, TOO_FAR
from sonic_bullet.records import Air, Array
from sonic_bullet.records.errors import AudioError

AT_REST = np.zeros((0, 0, 0, 3))
"""Places of microphones at a step's ends, where none moves."""


@dataclass(frozen=True, slots=True, eq=False)
class Path:
    """Constants of the sound path; microphone_m (c, 3)."""

    sr: int
    air: Air
    microphone_m: Array

    @property
    def samples_per_m(self) -> float:
        """Samples that sound needs for a metre."""
        return self.sr / self.air.sound_speed_m_s


@dataclass(slots=True, eq=False)
class PathState:
    """Sound under way.

    Attributes
    ----------
    at : the next sample
    sources, places, lines : (b,) SOURCE, (t,) PLACE, (t·c,) LINE, see src/tables.hpp; `hear` changes them in place
    memory : histories of the lines; arrays that `grow` has lengthened are new ones
    """

    at: int
    sources: Array
    places: Array
    lines: Array
    memory: Array

    def copy(self) -> PathState:
        """Return an independent copy: propagating one leaves the other."""
        arrays: dict[str, Any] = {
            field.name: getattr(self, field.name).copy() for field in fields(self) if field.name != "at"
        }
        return PathState(at=self.at, **arrays)


def empty_path(sr: int, air: Air, microphone_m: Array, at: int = 0) -> tuple[Path, PathState]:
    """Build a path without bodies to microphones (c, 3), and its state at absolute sample ``at``.

    Raises AudioError on a bad rate or place.
    """
    place = np.array(microphone_m, float).reshape(-1, 3)
    if not (0 < sr <= 10_000_000) or not np.isfinite(place).all():
        raise AudioError(
            f"sample rate {sr} and microphones at {place.tolist()}", "give a rate in Hz and finite positions"
        )
    state = PathState(int(at), np.zeros(0, SOURCE), np.zeros(0, PLACE), np.zeros(0, LINE), np.zeros(0))
    return Path(int(sr), air, place), state


def append_bodies(path: Path, state: PathState, radius_m: Array) -> tuple[Path, PathState]:
    """Return path and state with further bodies (k,), a place each; sound under way continues unchanged.

    The old pair stays usable.
    """
    radius = np.array(radius_m, float).ravel()
    if not np.isfinite(radius).all():
        raise AudioError("bodies with radii that are not finite", "give one finite number for every body")
    state = state.copy()
    count, known, first = len(radius), len(state.sources), len(state.places)
    new = np.zeros(count, SOURCE)
    new["radius_m"], new["left"], new["leaving"] = radius, -1, -1
    new["oldest"] = new["main"] = np.arange(first, first + count)
    state.sources = np.concatenate([state.sources, new])
    _add_places(path, state, count)
    state.places["body"][first:] = np.arange(known, known + count)
    return path, state


def subset(path: Path, state: PathState, keep: Array) -> PathState:
    """Return the state with only the bodies ``keep`` (k,), ascending; their sound continues unchanged, bit by bit.

    The others must be `silent`. The old state stays usable.
    """
    number, place = np.full(len(state.sources) + 1, -1), np.full(len(state.places) + 1, -1)  # and of -1, at the end
    number[keep] = np.arange(len(keep))
    stays = number[state.places["body"]] >= 0
    place[:-1][stays] = np.arange(np.count_nonzero(stays))
    sources, places = state.sources[keep], state.places[stays]
    for name in ("oldest", "main", "leaving"):
        sources[name] = place[sources[name]]
    sources["fresh"] = -1
    places["body"], places["next"] = number[places["body"]], place[places["next"]]
    each = len(path.microphone_m) * _stride(places["size"])
    parts = [state.memory[at : at + size] for at, size in zip(places["memory_at"], each, strict=True)]
    places["memory_at"] = np.cumsum(each) - each
    lines = state.lines.reshape(len(state.places), len(path.microphone_m))[stays].reshape(-1)
    return PathState(state.at, sources, places, lines, np.concatenate([np.zeros(0), *parts]))


def silent(path: Path, state: PathState) -> Array:
    """Return (b,) whether no sound of a body is under way."""
    awake = (state.lines["awake"].reshape(len(state.places), len(path.microphone_m)) != 0).any(axis=1)
    quiet = np.ones(len(state.sources), bool)
    quiet[state.places["body"][awake]] = False
    return quiet


def grow(path: Path, state: PathState, status: int) -> None:
    """Lengthen the tables after `hear` has returned one of both that ask for it. Raises AudioError otherwise."""
    if status == PLACES_SHORT:
        _add_places(path, state, len(state.sources))
    elif status == MEMORY_SHORT:
        places = state.places
        short = np.maximum(places["need"], places["size"])
        _resize(path, state, 2 ** np.ceil(np.log2(short)).astype(np.int64))
        places["need"] = 0
    elif status == TOO_FAR:
        away_m = state.sources["away_m"].copy()
        state.sources["away_m"] = 0.0
        body = int(np.flatnonzero(away_m)[0])
        raise AudioError(
            f"body {body} sounds {away_m[body]:.0f} m from a microphone",
            f"keep what sounds within {FARTHEST_M:.0f} m, or remove it",
        )
    else:
        raise AudioError(
            "a source, a push or a place that is not finite", "look for the step whose contacts or loads produced it"
        )


def _stride(size: Array) -> Array:
    """Return the numbers that a line stores."""
    return np.asarray(2 * (size + MIRRORED))


def _add_places(path: Path, state: PathState, count: int) -> None:
    """Add places, free and asleep."""
    shortest = 1024
    channels = len(path.microphone_m)
    new = np.zeros(count, PLACE)
    new["body"], new["next"], new["size"] = -1, -1, shortest
    each = channels * _stride(new["size"])
    new["memory_at"] = len(state.memory) + np.cumsum(each) - each
    state.places = np.concatenate([state.places, new])
    state.lines = np.concatenate([state.lines, np.zeros(count * channels, LINE)])
    state.memory = np.concatenate([state.memory, np.zeros(int(each.sum()))])


def _resize(path: Path, state: PathState, size: Array) -> None:
    """Give each place as many samples; histories stay where absolute time has them."""
    channels, places, former = len(path.microphone_m), state.places, state.memory
    each = channels * _stride(size)
    begins = np.cumsum(each) - each
    state.memory = np.zeros(int(each.sum()))
    for begin, new, place in zip(begins.tolist(), size.tolist(), places, strict=True):
        old, at = int(place["size"]), int(place["memory_at"])
        here = former[at : at + 2 * channels * (old + MIRRORED)].reshape(2 * channels, -1)
        there = state.memory[begin : begin + 2 * channels * (new + MIRRORED)].reshape(2 * channels, -1)
        if old == new:
            there[:] = here
            continue
        sample = np.arange(state.at - old, state.at)
        there[:, sample % new] = here[:, sample % old]
        there[:, new:] = there[:, :MIRRORED]
    places["size"], places["memory_at"] = size, begins
