"""Tables of the run time's compiled stages: one a kind of thing, each in a fixed place, rows by number.

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

from sonic_bullet.contact.load_splitting import HISTORY
from sonic_bullet.geometry.nearest_point import FACE, NODE
from sonic_bullet.records import Array
from sonic_bullet.records.contacts import CONTACT
from sonic_bullet.records.roughness import OCTAVES

__all__ = ["BODY", "CONTACT", "FACE", "NODE", "PAIR", "PULSE", "ROW", "StepScratch"]

BODY = np.dtype(
    [
        ("mass_kg", "f8"),  # 0 for what does not move
        ("inertia_kg_m2", "f8", (3, 3)),  # body frame
        ("jointed", "i8"),  # 1: how it moves is the mobility, not mass and inertia
        ("mobility", "f8", (6, 6)),  # velocity and spin per impulse and its moment, body frame
        ("modulus_pa", "f8"),  # E/(1-ν²), infinite where it is a rigid partner
        ("restitution", "f8"),  # infinite where it has no material
        ("roughness_m", "f8"),
        ("hurst", "f8"),
        ("octave_rms_m", "f8", (OCTAVES,)),  # the first below 0: roughness and hurst tell
        ("waviness_m", "f8"),  # 0: none known
        ("waviness_length_m", "f8"),
        ("crest_per_m", "f8"),  # curvature of its waves' crests
        ("track_at", "i8"),  # of a measured track's slopes by octave in the flat ones, and how many an octave has
        ("track_count", "i8"),  # 0: none
        ("track_spacing_m", "f8"),
        ("size_m", "f8"),  # cube root of the volume
        ("volume_m3", "f8"),
        ("curvature_per_m", "f8"),  # of a shape that has one everywhere; NaN: that of its faces
        ("edge_per_m", "f8"),  # curvature of its edges
        ("wall_m", "f8"),  # see geometry.nearest_point
        ("tie_m", "f8"),
        ("surface_seed", "i8"),
        ("rigid", "i8"),  # 1 where its translations are active
        ("modes", "i8"),  # audible modes
        ("columns", "i8"),  # the same and the lines of its residual: what shapes and gains are given for
        ("frequency_at", "i8"),  # of mode 0 in the flat array of frequencies in Hz (m,)
        ("shape_at", "i8"),  # of vertex 0, axis 0, column 0 in the flat shapes: + (3·vertex + axis)·columns + column
        ("face_at", "i8"),
        ("faces", "i8"),  # 0: no surface
        ("node_at", "i8"),
        ("placed", "i8"),  # step in which it began or was last teleported
        ("rebound", "f8"),  # restitution as the simulator has it; a pair's is the product
        ("loaded", "i8"),  # last step before the present one in which it carried load
        ("cause_m_s", "f8"),  # approach of its last strike that gravity and bouncing did not make, and its step
        ("cause_step", "i8"),
        ("since_m_s", "f8"),  # approach of the fastest such strike after that one, and its step
        ("since_step", "i8"),
        ("spread", "i8"),  # strikes dated by its phase so far (contact.load_splitting.phase_in_step)
        ("turn_at", "i8"),  # first row of TURN, and how many: its pairs of modes that are not as they are free
        ("turns", "i8"),
    ],
    align=True,
)

TURN = np.dtype([("mode", "i8"), ("by", "f8", (2, 2))], align=True)
"""A pair of modes, that mode and the next, turned from the free ones: their shapes times ``by``."""


ROW = np.dtype(
    [
        ("key", "i8"),  # of the pair: lower body << 32 | higher
        ("body", "i8", (2,)),
        ("impulse_n_s", "f8", (3,)),  # on the lower body, world frame
        ("normal", "f8", (3,)),  # towards the lower body, world frame
        ("load_n_s", "f8"),  # normal part of the impulse
        ("point_m", "f8", (2, 3)),  # in either body's frame
        ("outward", "f8", (2, 3)),  # the surface's normal there, body frame
        ("local_impulse_n_s", "f8", (2, 3)),  # impulse on that body, body frame
        ("arm_m", "f8", (2, 3)),  # from its centre, world frame
        ("sweep_m_s", "f8", (2,)),
        ("approach_m_s", "f8"),
        ("gap_m", "f8"),
        ("touched", "i8"),  # 1 once what follows is known
        ("face", "i8", (2,)),  # of the body's own faces, in tree order; -1: it has no surface
        ("barycentric", "f8", (2, 3)),
        ("curvature_per_m", "f8", (2,)),
    ],
    align=True,
)

PAIR = np.dtype(
    [
        ("key", "i8"),
        ("body", "i8", (2,)),
        ("force_n", "f8", (HISTORY,)),  # normal load of each step
        ("struck_n", "f8", (HISTORY,)),  # part of it used up by strikes
        ("support_n", "f8", (2,)),  # silent load at the rendered step's start and end
        ("rubs", "i8"),  # 1 while it has a voice: what follows holds
        ("load_n", "f8"),  # at the end of the step before
        ("sweep_m_s", "f8", (2,)),
        ("direction", "f8", (3,)),  # force on the lower body per newton of load, world; 0: not yet known
        ("gains", "i8"),  # 1 once its row of the gains is known
        ("mass_kg", "f8"),  # from here: constants of its voice
        ("modulus_pa", "f8"),
        ("radius_m", "f8"),
        ("damping_ratio", "f8"),
        ("dissipation_s_m", "f8"),
        ("seed", "i8", (2,)),
        ("height_m", "f8", (2, OCTAVES)),  # gains of the slopes, where a side has a track
        ("around", "f8", (2,)),  # coarsest lattice points round a round side, 0: endless (profile.close_round)
        ("stretch", "f8", (2,)),  # of its lattice, over 1
        ("track_at", "i8", (2,)),
        ("track_count", "i8", (2,)),
        ("track_spacing_m", "f8", (2,)),
        ("ball_m", "f8"),  # R* of a ball on a stated spectrum, 0: it follows all waves
        ("slope", "f8"),  # rms, of both surfaces; 0: not known, the contact is in spots
        ("depth", "f8"),  # from here: state of its voice
        ("separation_speed", "f8"),
        ("substeps", "i8"),
        ("swept_m", "f8", (2,)),
    ],
    align=True,
)

WINDOW = np.dtype([("dt_s", "f8"), ("gravity_m_s2", "f8", (3,)), ("row", "i8", (2,))], align=True)
"""A step of the last SPAN: its length, its gravity, and its rows, first and the one after the last."""

PULSE = np.dtype(
    [
        ("body", "i8", (2,)),
        ("start_s", "f8"),  # after the start of the step it was found in; before it, where negative
        ("length_s", "f8"),
        ("flat", "i8"),  # half-sine, not Hertz'
        ("share", "f8"),  # transmitted fraction of the impulse (contact.pulse_shape.compliance)
        ("impulse_n_s", "f8", (3,)),  # on the lower body, world frame
        ("ahead", "i8"),  # 0: found in the step being rendered, 1: in the one after it
    ],
    align=True,
)
"""One strike. Its Uᵀj on both bodies' columns stands beside it in an array (pulses, 2, columns)."""


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
