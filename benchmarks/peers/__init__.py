"""Other banks of modes, each timed in the same run: how many modes does one core sustain in real time?

    name, Debian packages, modes_sustained(scale) -> modes, 48 kHz, processor time      one module a peer

A peer writes its score, orchestra, program or synth definition into a temporary folder, runs the tool there and takes
its processor time. All ring all the time, struck ten times a second, so that none meets subnormal numbers.
scale: share of the usual length of sound; less than 1 says nothing of speed, only that it runs.
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass

from benchmarks.peers import c_tile, csound_mode, faust_modal, klank, plain_python


@dataclass(frozen=True, slots=True)
class Peer:
    """One other bank. must_hold: what its row says must hold of this project's bank beside it."""

    name: str
    modes_sustained: Callable[[float], float]
    must_hold: str = ""


PEERS = (
    Peer("SuperCollider Klank", klank.modes_sustained, "bank >= 12 x"),
    Peer("Csound `mode`", csound_mode.modes_sustained),
    Peer("Faust `pm.modalModel`", faust_modal.modes_sustained),
    Peer("numpy, exp of an outer product", plain_python.by_outer),
    Peer("scipy, `lfilter` a mode", plain_python.by_lfilter),
    Peer("C, register tile in float32", c_tile.modes_sustained),
)
