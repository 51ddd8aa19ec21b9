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
