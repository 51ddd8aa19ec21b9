"""Channels of what the driver made of steps: rigid motion added, then directions, the sensors' own chains, mixing."""

from __future__ import annotations

from typing import TYPE_CHECKING

from sonic_bullet.engine.path.room.room_convolution import sum_rows
from sonic_bullet.engine.path.space.space_state import hears_apart
from sonic_bullet.records import Array
from sonic_bullet.records.step_tables import StepTables
from sonic_bullet.records.touching.link_motions import NO_MOTIONS

if TYPE_CHECKING:
    from sonic_bullet.engine.runtime.synthesis_state import Setup, State


def finish_channels(setup: Setup, state: State, table: Array, steps: StepTables, out: Array, pressure: Array) -> Array:
    """Return (channels, n), or apart (b·channels, n); out, pressure: as the driver made them."""
    surface, space, bodies = state.surface, state.space, [one.body for one in state.resonators]
    if surface is not None:
        out = surface.add_rigid(table, steps.motions or (NO_MOTIONS,) * len(steps), out, state.body, bodies)
    if space is not None and hears_apart(setup.sensors):
        out = space.channels(table, out, pressure, apart=setup.apart)
    elif surface is not None and not setup.apart:
        out = out.reshape(len(state.body), len(setup.sensors), out.shape[1]).sum(axis=0)
    if surface is not None:
        out = surface.apply_chains(out)
        surface.add_noise(out, state.ringing.at - out.shape[1], bodies)
    return out if setup.mixing is None else sum_rows(setup.mixing, out)
