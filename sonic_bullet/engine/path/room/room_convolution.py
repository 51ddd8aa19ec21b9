"""Rows of a `RoomPlan` through its filters: overlap-add in pieces of one length, however the sound comes in.

out_c = own_c + Σ_g early_g * row_gc + Σ_f late_cf * far_f        [Oppenheim & Schafer 1989, sec. 8.9.3]
"""

from __future__ import annotations

from collections.abc import Iterable, Iterator

import numpy as np

from sonic_bullet.engine.path.room.room_plan import RoomPlan
from sonic_bullet.files.storage.spooled_sound import KeptSound, SoundSpool
from sonic_bullet.records import Array


def sum_rows(mixing: Array, channels: Array) -> Array:
    """Sum channels (b·c, n), body by body, to rows (b·r, n) by mixing (r, c); not by BLAS, whose threads cost more."""
    bodies, samples = len(channels) // mixing.shape[1], channels.shape[1]
    by_body = channels.reshape(bodies, mixing.shape[1], samples)
    return np.asarray(np.einsum("rc,bcn->brn", mixing, by_body).reshape(bodies * len(mixing), samples))


def add_room(plan: RoomPlan, blocks: Iterable[Array]) -> Iterator[Array]:
    """Filter blocks (rows, n) to blocks (channels, n), as long in all as these."""
    from scipy.fft import irfft, next_fast_len, rfft

    taps, own = plan.taps, plan.channels
    shortest = 1 << 15  # samples of a transform: shorter ones cost more a sample
    size = next_fast_len(max(shortest, 4 * taps), real=True)
    early, late = rfft(plan.early, size), rfft(plan.late, size)
    carried = np.zeros((own, taps - 1))
    for piece in in_pieces(blocks, size - taps + 1):
        n = piece.shape[1]
        rows = rfft(piece[own:], size)
        groups = rows[: len(early) * own].reshape(len(early), own, rows.shape[1])
        spectrum = np.einsum("cfk,fk->ck", late, rows[len(early) * own :]) + np.einsum("gk,gck->ck", early, groups)
        made = irfft(spectrum, size)[:, : n + taps - 1]
        made[:, : taps - 1] += carried
        carried = made[:, n:]
        yield piece[:own] + made[:, :n]


def in_pieces(blocks: Iterable[Array], length: int) -> Iterator[Array]:
    """Cut blocks (·, n) anew into pieces of one length, the last one shorter."""
    held: list[Array] = []
    count = 0
    for block in blocks:
        held.append(block)
        count += block.shape[1]
        if count >= length:
            whole = np.concatenate(held, axis=1)
            stop = count - count % length
            for at in range(0, stop, length):
                yield whole[:, at : at + length]
            held, count = [whole[:, stop:]], count - stop
    if count:
        yield np.concatenate(held, axis=1)


def keep_with_room(
    plan: RoomPlan, sound: KeptSound, tail_db: float | None = None, frames: int | None = None
) -> KeptSound:
    """Filter a sound of rows.

    With tail_db what follows its first ``frames`` ends that far below each channel's peak.
    """
    spool = SoundSpool(plan.channels)
    for block in add_room(plan, sound.blocks()):
        spool.add(np.ascontiguousarray(block))
    made = spool.finish()
    if tail_db is None or frames is None:
        return made
    weakest = 10 ** (tail_db / 20) * made.peaks()[:, None]
    rest = made.read(frames, made.shape[1])
    loud = np.flatnonzero((np.abs(rest) > weakest).any(axis=0))
    return KeptSound(spool, frames, rest[:, : loud[-1] + 1 if loud.size else 0])
