from typing import Any

import numpy as np

from sonic_bullet.records import Array

def vector_level() -> int: ...
def force_vector_level(level: int) -> None: ...

# geometry
FACE: np.dtype[Any]
NODE: np.dtype[Any]

def nearest_points(
    faces: Array,
    nodes: Array,
    wall_m: float,
    tie_m: float,
    point_m: Array,
    outward: Array,
    face: Array,
    found: Array,
) -> None: ...

# bank
BANK_BODY: np.dtype[Any]
RINGING: np.dtype[Any]
BANK_STRIKE: np.dtype[Any]
TRANSMISSION: np.dtype[Any]
TRANSMISSION_PHASES: dict[str, int]
LANE_PAIR: int
BLOCK: int
FLOOR: float
FLUSH: float
NODES_PER_PULSE: int
NODES_PER_SAMPLE: int
SHORTEST_PULSE: float

def advance_bank(at: int, n: int, sr: float, progress: Array, bank: Any, scratch: Any) -> None: ...
def enter_pulses(begin_s: float, after_s: float, at: int, sr: float, bank: Any, scratch: Any) -> int: ...
def enter_strike(
    body: int,
    start: float,
    length: float,
    flat: bool,
    fraction: float,
    gain: Array,
    impulse_n_s: Array,
    at: int,
    bank: Any,
) -> bool: ...
def take_coming(
    b: int,
    start: int,
    stop: int,
    ringing: Array,
    law: Array,
    pole: Array,
    block: Array,
    coming: Array,
) -> None: ...
def filter_swing(taps: Array, shape: Array, moved: Array, past: Array, swing: Array) -> None: ...

# contact/coupling
STOPPED_RATIO: float
STIFFEST_RATIO: float

def count_motions(system: Any) -> int: ...
def count_partner_modes(system: Any) -> int: ...
def couple_springs(system: Any, both: Array, stiffness: Array) -> None: ...
def choose_motions(vector: Array, pairs: Array, chosen: Array) -> None: ...
def solve_motions(system: Any, motions: Any, poles: Any) -> None: ...
def place_points(
    tables: Any,
    quaternion: Array,
    patch: Array,
    both: Array,
    turn: Array,
    lower: Array,
    higher: Array,
    curvature_per_m: Array,
) -> float: ...

# modal
DIPOLE_FACES: int
DIPOLE_GROUPS: int

def pack_triangle(matrix: Array, packed: Array) -> None: ...
def add_triangle(packed: Array, place: Array, column: Array, rest: Array) -> None: ...
def winding_numbers(corner_m: Array, group: Array, first: Array, point_m: Array, winding: Array) -> None: ...

# residual
def count_level_steps(power: Array, most: float, step_db: float, step: Array) -> None: ...
def mix_grains(grains: Array, first: float, second: float, mixed: Array) -> None: ...
def filter_grains(base: Array, gain: Array, filtered: Array) -> None: ...
def shape_spectrum(spectrum: Array, base: Array, first: Array, second: Array) -> None: ...
def add_damped_lines(pole: Array, amplitude: Array, length: Array, sound: Array) -> None: ...
def renew_phases(spectrum: Array, before: Array, magnitude: Array, momentum: float) -> None: ...
def power_ratios(
    freq_hz: Array,
    centre_hz: Array,
    half_hz: Array,
    source_power: Array,
    target_power: Array,
    ratio: Array,
) -> None: ...
def move_power(
    freq_hz: Array,
    time_s: Array,
    per_hz: Array,
    source_hz: Array,
    level: Array,
    rate: Array,
    at_s: Array,
    row: Array,
    moved: Array,
) -> None: ...

# effects
def sum_baseband(sample: Array, omega: float, theta: float, sums: Array) -> None: ...
def add_linear_modes(log_pole: Array, amplitude: Array, length: Array, start: float, sound: Array) -> None: ...
def add_level_modes(modes: Any, length: Array, start: float, sample_rate_hz: float, sound: Array) -> None: ...

# signal
def cut_frames(sample: Array, window: Array, hop: int, frames: Array) -> None: ...
def add_frames(frames: Array, window: Array, hop: int, sample: Array) -> None: ...
