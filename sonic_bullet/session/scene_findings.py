"""Findings that only a scene's listener knows: which bodies were added, and whether they have modes."""

from __future__ import annotations

from collections.abc import Collection, Mapping
from pathlib import Path

from sonic_bullet.records.simulated import with_body_id
from sonic_bullet.session.listening import Listener
from sonic_bullet.simulators import Finding


def find_nothing_added(listener: Listener) -> tuple[Finding, ...]:
    """Report a world with bodies of which none has a material."""
    if not listener.world.has_bodies or any(body.material is not None for body in listener.world.bodies):
        return ()
    return (
        Finding(
            "nothing-added",
            "error",
            "no body has a material: all are silent partners",
            "add(body, material=…), or return it in build's cast",
        ),
    )


def find_mute_bodies(listener: Listener) -> tuple[Finding, ...]:
    """Report bodies without an audible mode."""
    return tuple(
        Finding(
            "no-audible-mode",
            "info",
            f"{with_body_id(body.name, body.body_id)} has no mode below 20 kHz: it clicks but does not ring",
            "nothing to mend; a larger or thinner body rings",
        )
        for body in listener.contacts.bodies
        if body.model is not None and body.model.mode_count == 0 and len(body.model.face) and not body.model.unsolved
    )


def find_real_time(lines: Collection[tuple[str, int]]) -> tuple[Finding, ...]:
    """Report the lines (file, line) that turn real-time simulation on."""
    return tuple(
        Finding(
            "real-time",
            "info",
            f"'{Path(file).name}' line {line} turns real-time simulation on: render, play, film and compare step it "
            "for as long as the script waits; run by itself, with attach, nobody sees its steps",
            "setRealTimeSimulation(0) there, and call stepSimulation",
        )
        for file, line in sorted(lines)
    )


def find_clock_loops(looks: Mapping[tuple[str, int], int]) -> tuple[Finding, ...]:
    """Report the lines that read the clock in a loop; looks: how often each line (file, line) did."""
    loop = 3  # looks of one line from which on it stands in a loop
    return tuple(
        Finding(
            "wall-clock",
            "info",
            f"'{Path(file).name}' line {line} reads the clock in a loop: render, play, film and compare let it read "
            "the simulation's; run by itself, with attach, it goes by the wall clock, and no two runs sound alike",
            "count steps there, or read the listener's time_s",
        )
        for (file, line), count in sorted(looks.items())
        if count >= loop
    )
