"""Tables of the run time's stages: one a kind of thing, each in a fixed place, rows by number. Fields: src/tables.hpp.

    Body -> BODY row + FACE, NODE rows and a slice of the shapes       once, when it is added
    contact rows of a step -> ROW (turned onto the pair's lower body)  four steps at a time: the step and its look-ahead
    pair of touching bodies -> PAIR, as long as it touches             load history, voice of friction
    strike -> PULSE                                                    one step

Records are used at the interfaces (what a user passes, what a file holds); these tables are used inside, checked in
bulk when they are filled. Sides are 0 = the pair's lower body and 1 = the higher. b bodies, m modes.
"""

from __future__ import annotations

from dataclasses import dataclass, field

import numpy as np

from sonic_bullet._engine import BODY, CONTACT, FACE, NODE, PAIR, PULSE, ROW, TURN, WINDOW
from sonic_bullet.records import Array

__all__ = ["BODY", "CONTACT", "FACE", "NODE", "PAIR", "PULSE", "ROW", "TURN", "WINDOW", "StepScratch"]


@dataclass(slots=True, eq=False)
class StepScratch:
    """Scratch of one step.

    count (2,): its pulses and drives. pulse (p,) PULSE with modal_impulse (p, 2, columns); drives d: force (d·n,),
    gain0, gain1 (d, 2, columns), direction0, direction1 (d, 3), body (d, 2), slot (d,). source (W, b, n), dipole
    (b, 3, n), sounds (b, 2): which rows of these are not zero; transmitted (W, b, n): zeros.
    """

    count: Array = field(default_factory=lambda: np.zeros(2, np.int64))
    pulse: Array = field(default_factory=lambda: np.zeros(0, PULSE))
    modal_impulse: Array = field(default_factory=lambda: np.zeros((0, 2, 0)))
    force: Array = field(default_factory=lambda: np.zeros(0))
    gain0: Array = field(default_factory=lambda: np.zeros((0, 2, 0)))
    gain1: Array = field(default_factory=lambda: np.zeros((0, 2, 0)))
    direction0: Array = field(default_factory=lambda: np.zeros((0, 3)))
    direction1: Array = field(default_factory=lambda: np.zeros((0, 3)))
    body: Array = field(default_factory=lambda: np.zeros((0, 2), np.int64))
    slot: Array = field(default_factory=lambda: np.zeros(0, np.int64))
    source: Array = field(default_factory=lambda: np.zeros((1, 0, 0)))
    transmitted: Array = field(default_factory=lambda: np.zeros((1, 0, 0)))
    dipole: Array = field(default_factory=lambda: np.zeros((0, 3, 0)))
    sounds: Array = field(default_factory=lambda: np.zeros((0, 2), np.int64))
    samples: int = -1  # capacity in samples

    def fit(self, drives: int, columns: int, samples: int, shape: tuple[int, int]) -> None:
        """Enlarge what is too small for so many drives and twice as many pulses. shape: weight sets and bodies."""
        samples = self.samples = max(self.samples, samples)  # steps of no whole number of samples differ by one
        if len(self.slot) < drives or self.modal_impulse.shape[2] != columns:
            drives = max(drives, 2 * len(self.slot))
            self.pulse, self.modal_impulse = np.zeros(2 * drives, PULSE), np.zeros((2 * drives, 2, columns))
            self.gain0, self.gain1 = np.zeros((2, drives, 2, columns))
            self.direction0, self.direction1 = np.zeros((2, drives, 3))
            self.body, self.slot = np.zeros((drives, 2), np.int64), np.zeros(drives, np.int64)
        if len(self.force) < len(self.slot) * samples:
            self.force = np.zeros(len(self.slot) * samples)
        if self.source.shape[:2] != shape or self.source.shape[2] < samples:
            self.source, self.dipole = np.zeros((*shape, samples)), np.zeros((shape[1], 3, samples))
            self.sounds, self.transmitted = np.zeros((shape[1], 2), np.int64), np.zeros((*shape, samples))
