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

# path
SOURCE: np.dtype[Any]
PLACE: np.dtype[Any]
LINE: np.dtype[Any]
IMAGE: np.dtype[Any]
TAPS: int
MIRRORED: int
HALF_DEGREE: int
FARTHEST_M: float
PATH_DONE: int
MEMORY_SHORT: int
PLACES_SHORT: int
TOO_FAR: int
NOT_FINITE: int

def tap_polynomials(out: Array) -> None: ...
def hear(at: int, step: int, n: int, emission: object, course: object, path: object, arrivals: object) -> int: ...
def image_gains(
    images: Array,
    has_image: Array,
    begin_m: Array,
    end_m: Array,
    begin_xyzw: Array,
    end_xyzw: Array,
    aim_m: Array,
    microphone_m: Array,
    gain: Array,
) -> None: ...
def spherical_harmonics(direction: Array, order: int, out: Array) -> None: ...
def encode_ambisonics(
    first: Array,
    count: Array,
    along: Array,
    pressure: Array,
    away: Array,
    order: int,
    out: Array,
    apart: bool,
) -> None: ...
def filter_ears(
    first: Array,
    count: Array,
    along: Array,
    pressure: Array,
    past: Array,
    response: Array,
    out: Array,
    apart: bool,
) -> None: ...
def filter_rows(taps: Array, signal: Array, out: Array) -> None: ...

# radiation
def static_kernels(corner_m: Array, normal: Array, out: Array) -> None: ...
def surface_wave_matrices(k: float, b: float, place: Array, kernels: Array, left: Array, right: Array) -> None: ...
def sum_patches(k: Array, moment: Array, place: Array, direction: Array, ahead: Array, behind: Array) -> None: ...

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
