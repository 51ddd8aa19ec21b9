"""Stems of a contact log, one a body: the run time without the last sum.

    ContactLog -> the same stages on the same tables -> hear, a row a body -> (bodies · channels, n)

Contacts are those of the mix: a body that is struck by another sounds as it does there, and only what it emits itself
is its stem. Pressure is linear in the sources [Pierce 1989, sec. 4-3], so the stems' sum is the mix, to rounding.
"""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import replace
from typing import TYPE_CHECKING

from sonic_bullet.engine.runtime.body_lifetime import admit, release
from sonic_bullet.engine.runtime.channels.body_images import complete_setup
from sonic_bullet.engine.runtime.replay import make_radiation_known, quenched_steps, together
from sonic_bullet.engine.runtime.ringing_on import ring_on
from sonic_bullet.engine.runtime.synthesis_state import Setup, StepObserver, start
from sonic_bullet.engine.runtime.synthesizer import LOOK_EVERY, advance, clock_after, drain_steps
from sonic_bullet.files import check_sr
from sonic_bullet.files.contact_log import ContactLog
from sonic_bullet.machine.progress import report_fraction
from sonic_bullet.records import Array

if TYPE_CHECKING:
    from sonic_bullet.engine.path.room.room_plan import RoomPlan
    from sonic_bullet.records.contacts import Step


def render_per_body(
    log: ContactLog,
    *,
    sr: int | None = None,
    frames: int | None = None,
    observer: StepObserver | None = None,
    room: RoomPlan | None = None,
) -> Iterator[tuple[Array, Array]]:
    """Render pieces as `render_blocks`, before bodies are summed.

    Yields (b,) indices of the bodies in the log, ascending, and (b, channels, n) pascals. Other bodies are silent
    meanwhile.

    Parameters
    ----------
    frames
        Number of samples in all, where a mix rings on after the last step (ringing_on.py); None: up to its end.
    observer
        Observer that is called with every step.
    room
        What it is in.

    Raises
    ------
    AudioError, LogError
        As `render_log`.
    """
    log = replace(log, sr=check_sr(sr if sr is not None else log.sr))
    make_radiation_known(log)
    setup = Setup(
        log.sr, log.sensors, log.seed, log.air, residual=log.residual, apart=True, supports=log.supports, room=room
    )
    setup = complete_setup(setup, image=log.image)
    state = start(setup)
    state.observer = observer
    quenches, done, looked = quenched_steps(log), 0, 0
    last: Step | None = None
    for steps in together(log, quenches):
        if done in quenches:
            state.quenches = state.quenches | {done}
        if steps.body is not state.present:
            admit(setup, state, steps.step(0), log.bodies)
        body, frame = state.body, advance(setup, state, steps)
        yield body, frame.reshape(len(body), setup.channels, frame.shape[1])
        done, last = done + len(steps), steps.step(-1)
        if state.present is not state.body and done >= looked + LOOK_EVERY:
            looked = done
            release(state)
        report_fraction(done / len(log.steps))
    body, frame = state.body, drain_steps(setup, state, last)
    yield body, frame.reshape(len(body), setup.channels, frame.shape[1])
    missing = 0 if frames is None or last is None else frames - clock_after(state).sample(log.sr)
    for block in ring_on(setup, state, last) if missing > 0 and last is not None else ():
        frame = block[:, :missing]
        yield body, frame.reshape(len(body), setup.channels, frame.shape[1])
        missing -= frame.shape[1]
        if missing <= 0:
            break
