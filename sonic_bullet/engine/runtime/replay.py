"""Replay of a contact log: the run time with all steps at hand.

ContactLog -> radiation of its bodies -> steps of the same bodies, up to 64 -> Synthesizer -> blocks, all, or kept
"""

from __future__ import annotations

from collections.abc import Callable, Iterable, Iterator
from dataclasses import replace

import numpy as np

from sonic_bullet.engine.path.room import room_of
from sonic_bullet.engine.path.room.room_convolution import add_room, keep_with_room
from sonic_bullet.engine.path.room.room_plan import RoomPlan
from sonic_bullet.engine.runtime.ringing_on import TAIL_DB, as_tail_db
from sonic_bullet.engine.runtime.silence import body_notes, render_notes, silence_notes, why_silent
from sonic_bullet.engine.runtime.synthesizer import LATENCY_STEPS, Synthesizer
from sonic_bullet.files import check_sr
from sonic_bullet.files.contact_log import ContactLog
from sonic_bullet.files.storage.spooled_sound import KeptSound, SoundSpool
from sonic_bullet.machine.progress import report_fraction, report_progress, show_progress
from sonic_bullet.radiation.radiated import radiation_of
from sonic_bullet.records import Array, RoomResponse, ShoeboxRoom, channels_of
from sonic_bullet.records.coerce import as_call, as_flag, as_kind
from sonic_bullet.records.counts import format_count
from sonic_bullet.records.errors import LogError, SonicBulletError
from sonic_bullet.records.step_tables import StepTables

__all__ = [
    "LATENCY_STEPS",
    "TAIL_DB",
    "Synthesizer",
    "as_tail_db",
    "body_notes",
    "log_frames",
    "numbered_groups",
    "render_blocks",
    "render_kept",
    "render_log",
    "render_notes",
    "silence_notes",
    "why_silent",
]


def render_log(
    log: ContactLog,
    *,
    sr: int | None = None,
    residual: bool | None = None,
    room: ShoeboxRoom | RoomResponse | None = None,
    progress: Callable[[float], None] | None = None,
    say: Callable[[str], None] | None = None,
) -> Array:
    """Render a contact log: (channels, floor(sr·time)) in pascals; at the log's own rate the same bits as live.

    Its events act where they did: at the first sample of the same step, at any rate. All of it is in memory at once:
    `render_blocks` gives it in pieces.

    Parameters
    ----------
    residual
        Whether materials' residuals sound, None: as the log says.
    room
        A room around it, a box or one that was measured; None: free air.
    progress
        Called with the fraction done.
    say
        Called with what is being computed before the first step.

    Raises
    ------
    AudioError
        The rate is impossible.
    LogError
        ``log`` is no log.
    SceneError
        The room is smaller than what is in it, or its response has other channels.
    """
    with show_progress(as_call(say, "say"), as_call(progress, "progress"), in_percent=True):
        blocks = [*render_blocks(log, sr=sr, residual=residual, room=room)]
    return np.ascontiguousarray(np.concatenate(blocks, axis=1))


def render_blocks(
    log: ContactLog,
    *,
    sr: int | None = None,
    residual: bool | None = None,
    room: ShoeboxRoom | RoomResponse | None = None,
) -> Iterator[Array]:
    """Render a contact log in pieces (channels, n) of some steps each, for logs longer than the memory.

    Arguments and errors: as of `render_log`; arguments are checked at once.
    """
    log, residual = _check_arguments(log, sr, residual)
    if room is None:
        return _blocks(log, _synthesizer(log, residual))
    plan = room_of(room, log)
    log = replace(log, sensors=plan.sensors)
    return add_room(plan, _blocks(log, _synthesizer(log, residual, plan)))


def _check_arguments(log: ContactLog, sr: object, residual: object) -> tuple[ContactLog, bool]:
    """Check the arguments; return a log at the rate asked for, and whether residuals sound.

    Raises AudioError, LogError.
    """
    as_kind(log, ContactLog, "log", "give listener.contacts, or read_log(path)", error=LogError)
    log = replace(log, sr=check_sr(sr if sr is not None else log.sr))
    residual = log.residual if residual is None else as_flag(residual, "residual")
    return log, residual


def render_kept(
    log: ContactLog,
    *,
    sr: int | None = None,
    residual: bool | None = None,
    tail_db: float | None = None,
    plan: RoomPlan | None = None,
) -> KeptSound:
    """Render a contact log, beyond a few seconds into a nameless temporary file.

    Arguments: as of `render_log`, and plan: of the room around it (room_plan.py), and tail_db: ring on after the last
    step until that far below the peak, -60 say, at most 10 s; None, 0: end with it.

    Raises
    ------
    AudioError, LogError, FileError
        As `render_log`, FileError where the disk is full.
        The exception, Ctrl-C too, carries what was rendered so far as ``kept``.
    """
    tail_db = as_tail_db(tail_db)
    log, residual = _check_arguments(log, sr, residual)
    if plan is not None:
        log = replace(log, sensors=plan.sensors)
    synth = _synthesizer(log, residual, plan)
    spool = SoundSpool(channels_of(log.sensors) if plan is None else len(plan.mixing))
    try:
        for block in _blocks(log, synth):
            if spool.tail[0]:
                spool.add(block)
        sound = spool.finish() if spool.tail[0] else KeptSound.of(block)
        if plan is None:
            return synth.with_tail(sound, tail_db) if spool.tail[0] else sound
        longer_s = plan.ring_s(tail_db) if tail_db is not None else 0.0
        return keep_with_room(plan, synth.with_tail(sound, tail_db, longer_s), tail_db, sound.shape[1])
    except (SonicBulletError, KeyboardInterrupt) as error:
        error.kept = spool.finish() if plan is None else keep_with_room(plan, spool.finish())  # type: ignore[union-attr]
        raise


def _blocks(log: ContactLog, synth: Synthesizer) -> Iterator[Array]:
    make_radiation_known(log)
    quenches = quenched_steps(log)
    for done, steps in numbered_groups(log.tables(), quenches):
        if done in quenches:
            synth.quench()
        yield synth.play(steps, log.bodies)
        report_fraction((done + len(steps)) / len(log.steps))
    yield synth.rest()


def _synthesizer(log: ContactLog, residual: bool, room: RoomPlan | None = None) -> Synthesizer:
    return Synthesizer(
        sr=log.sr, sensors=log.sensors, seed=log.seed, air=log.air, residual=residual, supports=log.supports,
        image=log.image, room=room, keep=False,
    )  # fmt: skip


def make_radiation_known(log: ContactLog) -> None:
    """Compute the radiation of the bodies' modes where it is not cached."""
    for body in log.bodies if log.sensors else ():
        if body.model is not None and body.model.mode_count:
            report_progress(f"how {format_count(body.model.mode_count, 'mode')} of {body.name} radiate")
            radiation_of(body.model, log.air)


def quenched_steps(log: ContactLog) -> set[int]:
    """Return the steps before which all ringing stops."""
    return {event.step for event in log.events if event.kind == "quench"}


def together(log: ContactLog, quenches: set[int]) -> Iterator[StepTables]:
    """Iterate over the steps that a replay takes in at once: of the same bodies, with no quench between."""
    return (steps for _, steps in numbered_groups(log.tables(), quenches))


def numbered_groups(tables: Iterable[StepTables], quenches: set[int]) -> Iterator[tuple[int, StepTables]]:
    """Iterate over the steps of tables as `together` does, each group with the number of its first."""
    at_once = 64  # steps that a replay takes in at once, between two reports of progress
    done = 0
    for one in tables:
        first, ends = 0, {q - done for q in quenches if 0 < q - done < len(one)}
        for stop in sorted(ends | {*range(at_once, len(one), at_once), len(one)}):
            yield done + first, one.part(first, stop)
            first = stop
        done += len(one)


def log_frames(log: ContactLog) -> Iterator[Array]:
    """Render a contact log a step at a time, as `Listener.frame` had it: (channels, n), `LATENCY_STEPS` late."""
    make_radiation_known(log)
    synth = _synthesizer(log, log.residual)
    quenches = quenched_steps(log)
    for number, step in enumerate(log.steps):
        if number in quenches:
            synth.quench()
        yield synth.feed(step, log.bodies)
