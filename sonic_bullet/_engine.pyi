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

# listener
CONTACT: np.dtype[Any]
LINK_STATE: np.dtype[Any]
START: np.dtype[Any]
RAW: np.dtype[Any]
TOUCH: np.dtype[Any]
TRACE: np.dtype[Any]
SOFT_IMPACT: np.dtype[Any]
HELD_POINT: np.dtype[Any]
PAIR_LOAD: np.dtype[Any]
LINK_SPAN: int
LEFT_OUT: int
INVALID_BEYOND: float
MEMORY_STEPS: int
LONGEST_IMPACT_S: float
UNKNOWN_LINK: int
NEW_LINKS: int
ABSURD_NUMBER: int
UNUSUAL_STEP: int

def pack_contacts(contacts: tuple[Any, ...]) -> Array: ...
def read_contacts(question: Any, options: dict[str, Any]) -> tuple[Any, Array]: ...
def read_states(
    joint_count: Any, pose: Any, twist: Any, link_states: Any, bodies: tuple[Any, ...], links: int
) -> tuple[Array, int]: ...
def read_mujoco_motion(
    body: Array,
    centre_m: Array,
    orientation: Array,
    inertia_frame: Array,
    velocity: Array,
    tree_centre_m: Array,
    root: Array,
    state: Array,
) -> None: ...
def load_contacts(reported: Array, before: Array, dt_s: float, loaded: Array) -> int: ...
def begin_step(earlier: Array, later: Array, dt_s: float, moved_bodies: Array, hooked: bool, start: Array) -> int: ...
def make_contact_rows(
    loaded: Array, before: Array, start: Array, dt_s: float, time_s: float, traces: Any, row: Array
) -> int: ...
def place_bodies(start: Array, position_m: Array, quaternion_xyzw: Array, teleported: Array) -> None: ...
def take_step(
    reported: Array,
    reported_before: Array,
    before: Array,
    earlier: Array,
    later: Array,
    moved_bodies: Array,
    hooked: bool,
    dt_s: float,
    time_s: float,
    traces: Any,
    start: Array,
    bodies: int,
) -> tuple[int, int, Array, Array, Array, Array, Array]: ...
def rotation_between(first: Array, second: Array, vector_rad: Array) -> None: ...
def sort_pairs(row: Array, trace: Array, sorting: Array) -> None: ...
def collect_rows(row: Array, weight_n: Array, dt_s: float, fall_m_s: float, tables: Any) -> None: ...
