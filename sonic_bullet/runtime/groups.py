"""Groups of the run time's tables, as its kernels take them; each field is named as where Python keeps it.

    State -> `gather` -> window, table, pairs, supports, bank, scratch, path  ┐
    steps at hand -> call, given, frames                                      ┴ one flat tuple -> driver.advance_steps

The driver makes the groups of it (`machine.grouping`). tests/runtime/test_groups.py holds that nothing is left out.
"""

from __future__ import annotations

from typing import NamedTuple

from sonic_bullet.bank.layout import BankTables, ScratchTables
from sonic_bullet.path.path_places import PathTables
from sonic_bullet.records import Array


class DriverCall(NamedTuple):
    """What is asked of the driver in this call.

    first: the first step of the table that is not done; taken: number of the table's first; pause: return before `hear`
    of the first step; resume: progress of the first step.
    """

    first: int
    taken: int
    pause: bool
    resume: int
    sr: float


class StepTables(NamedTuple):
    """Steps that are taken in: (k,) STEP, contacts of all, poses (k, b, 3), (k, b, 4), (k, b).

    aim_m (k + 1, b, c, 3): as `path_kernel.hear` has it, at each step's start and the last one's end; (0, …): at rest.
    """

    steps: Array
    contacts: Array
    position: Array
    quaternion: Array
    teleported: Array
    aim_m: Array


class Frames(NamedTuple):
    """What the driver fills: out (channels, ·), from sample ``start`` on, and pressure (microphones, ·).

    apart 1: out is (bodies·channels, …) and pressure (bodies·microphones, …), body by body, nothing summed. reads (c,):
    weight set of each channel, 0 for a microphone; sets: of each microphone.
    """

    start: int
    apart: int
    reads: Array
    sets: Array
    pressure: Array
    out: Array


class WindowTables(NamedTuple):
    """The last SPAN steps: fields of `synthesis_state.Window`; and faces that mirror: of `body_images.BodyImages`."""

    step: Array
    position_m: Array
    quaternion_xyzw: Array
    teleported: Array
    row: Array
    images: Array
    has_image: Array


class BodyTables(NamedTuple):
    """Bodies and what belongs to their models: attributes of `body_table.BodyTable`."""

    bodies: Array
    faces: Array
    nodes: Array
    shapes: Array
    turns: Array
    frequency_hz: Array
    spectrum: Array
    tracks: Array


class PairTables(NamedTuple):
    """Pairs that touch: fields of `synthesis_state.TouchingPairs`."""

    pair: Array
    active: Array
    count: Array  # type: ignore[assignment]
    free: Array
    gain: Array
    patch: Array


class SupportTables(NamedTuple):
    """Support states (b,) SUPPORT_STATE, and time left for new poles, (1,), (0,) where nothing supports."""

    support_state: Array
    credit_s: Array


class Groups(NamedTuple):
    """All that the driver takes, in this order."""

    call: DriverCall
    given: StepTables
    frames: Frames
    window: WindowTables
    table: BodyTables
    pairs: PairTables
    supports: SupportTables
    bank: BankTables
    scratch: ScratchTables
    path: PathTables
