from typing import Any

import numpy as np

from sonic_bullet.records import Array

def vector_level() -> int: ...
def best_vector_level() -> int: ...
def force_vector_level(level: int) -> None: ...

# math
def exp_into(x: Array, out: Array) -> None: ...
def expm1_into(x: Array, out: Array) -> None: ...
def log_into(x: Array, out: Array) -> None: ...
def log1p_into(x: Array, out: Array) -> None: ...
def sin_into(x: Array, out: Array) -> None: ...
def cos_into(x: Array, out: Array) -> None: ...
def cbrt_into(x: Array, out: Array) -> None: ...
def erf_into(x: Array, out: Array) -> None: ...
def pow_into(x: Array, y: Array, out: Array) -> None: ...
def atan2_into(y: Array, x: Array, out: Array) -> None: ...
def cexp_into(z: Array, out: Array) -> None: ...
def power(x: float, y: float) -> float: ...
def multiply(a: Array, b: Array, out: Array) -> None: ...

EIGEN_ROWS: int

def eigenpairs(a: Array, value: Array, scratch: Array) -> bool: ...

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
def set_poles(b: int, step: Array, separation: Array, free_law: Array, bank: Any) -> None: ...
def set_transmissions(b: int, to: Array, weight: Array, bank: Any) -> None: ...
def filter_swing(taps: Array, shape: Array, moved: Array, past: Array, swing: Array) -> None: ...

# contact/coupling
STOPPED_RATIO: float
STIFFEST_RATIO: float

def assign_columns(weight: Array, column: Array) -> None: ...
def choose_motions(vector: Array, pairs: Array, chosen: Array) -> None: ...
def couple_modes(system: Any, direction: Array, pairs: Array, before: Array, poles: Any, force_n_s: Array) -> bool: ...
def fill_touches(
    b: int,
    places: Array,
    begin: Array,
    tables: Any,
    pairs: Any,
    quaternion: Array,
    sides: Any,
    touches: Any,
) -> None: ...

# contact
BODY: np.dtype[Any]
CONTACT: np.dtype[Any]
CONTACT_PATCH: np.dtype[Any]
PAIR: np.dtype[Any]
PULSE: np.dtype[Any]
ROW: np.dtype[Any]
STRIKE: np.dtype[Any]
SUPPORT_STATE: np.dtype[Any]
TURN: np.dtype[Any]
VOICE: np.dtype[Any]
WINDOW: np.dtype[Any]
CREASE_COS: float
EDGE_MARGIN: float
FASTEST_M_S: float
FLAT_CURVATURE: float
FOLLOW_S: float
HISTORY: int
LONGEST_PULSE_S: float
LONGEST_WAVE_M: float
LOOKAHEAD: int
NOW: int
OCTAVES: int
PATCH_POINTS: int
PERSSON: float
PULSE_CELLS: int
SAVED_S: float
SHORTEST_PULSE_S: float
SIZELESS_M: float
SPAN: int
SPECTRUM_CELLS_PER_F_TAU: int
STRUCK_FLAT: float
SWEEP_FLOOR_M_S: float
UNIT_RMS: float

def orient(contacts: Array, quaternion_xyzw: Array, rows: Array) -> None: ...
def enter_loads(rows: Array, start: int, stop: int, dt_s: float, pairs: Any) -> None: ...
def split_loads(ahead: int, number: int, window: Any, pairs: Any, strikes: Array) -> int: ...
def set_gravity_steps(ahead: int, number: int, pairs: Any, bodies: Array, gravity_steps: Array) -> None: ...
def accept_strikes(strikes: Array, bodies: Array) -> None: ...
def phase_in_step(seed: int, count: int) -> float: ...
def find_pulses(
    ahead: int,
    number: int,
    found: int,
    window: Any,
    table: Any,
    pairs: Any,
    strikes: Array,
    scratch: Any,
) -> int: ...
def contact_modulus(low_pa: float, high_pa: float) -> float: ...
def pulse_length(
    mass_kg: float,
    modulus_pa: float,
    relative_curvature_per_m: float,
    flat_area_m2: float,
    approach_m_s: float,
) -> tuple[float, int]: ...
def rough_stretch(
    mass_kg: float,
    modulus_pa: float,
    relative_curvature_per_m: float,
    approach_m_s: float,
    layer_m: float,
) -> float: ...
def compliance(modal_impulse: Array, frequency_hz: Array, tau_s: float, spectrum: Array) -> float: ...
def fill_pulse_table(table: Array) -> None: ...
def cumulated(s: Array, flat: bool, q: Array) -> None: ...
def find_contact_points(rows: Array, table: Any) -> None: ...
def add_modal_impulse(rows: Array, r: int, side: int, factor: float, table: Any, out: Array) -> None: ...
def turn_modal_impulse(bodies: Array, b: int, turns: Array, out: Array) -> None: ...
def effective_mass(
    bodies: Array,
    low: int,
    high: int,
    quaternion_xyzw: Array,
    arm_low_m: Array,
    arm_high_m: Array,
    normal: Array,
) -> float: ...
def flat_area_m2(
    bodies: Array,
    low: int,
    high: int,
    spread_m: float,
    curvature_per_m: float,
    least_fraction: float,
) -> float: ...
def height_octaves(roughness_m: float, hurst: float, height_m: Array) -> None: ...
def add_waves(rms_m: float, length_m: float, height_m: Array) -> None: ...
def slope_squared(height_m: Array) -> float: ...
def reach_of_ball(wave_m: float, patch_radius_m: float, radius_m: float) -> float: ...
def close_round(length_m: float, height_m: Array) -> tuple[float, float]: ...
def gained_heights(
    height_m: Array,
    speed_m_s: float,
    patch_radius_m: float,
    touching: float,
    ball_m: float,
    sr: float,
    gained_m: Array,
) -> None: ...
def sweep_profile(
    swept_m: float,
    speed_m_s: tuple[float, float],
    x: Array,
    seed: int,
    around: float,
    stretch: float,
    height_m: Array,
    per_sample_s: float,
    rate_m_s: Array,
) -> float: ...
def sweep_track(
    swept_m: float,
    speed_m_s: tuple[float, float],
    x: Array,
    slopes: Array,
    spacing_m: float,
    gains: Array,
    per_sample_s: float,
    rate_m_s: Array,
) -> float: ...
def dissipation_s_m(restitution: float) -> float: ...
def contact_radius_m(relative_curvature_per_m: float, flat_area_m2: float) -> float: ...
def ball_patch_m(load_n: float, modulus_pa: float, radius_m: float) -> float: ...
def sound_voices(pairs: Array, voices: Array, x: Array, sr: float, tracks: Array, force_n: Array) -> None: ...
def advance_friction(
    number: int,
    x: Array,
    sr: float,
    window: Any,
    table: Any,
    pairs: Any,
    scratch: Any,
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

# listener
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

class StateReader:
    def __init__(
        self,
        joint_count: Any,
        pose: Any,
        twist: Any,
        link_states: Any,
        bodies: tuple[Any, ...],
        links: int,
        hooked: bool,
    ) -> None: ...
    def forget(self) -> None: ...
    def read(self) -> tuple[Array, int]: ...

class StepReader:
    def __init__(self, contacts: Any, parameters: Any, client_id: int) -> None: ...
    settings: tuple[float, int, tuple[float, float, float]]
    reported: Array
    reported_before: Array
    count: int
    loaded: Array
    waiting: int
    waiting_contacts: int
    def read_settings(self) -> bool: ...
    def poll(self, stepped: bool) -> tuple[Any, ...]: ...
    def give(self, rows: Array) -> None: ...
    def forget_before(self) -> None: ...
    def set_loaded(self, rows: Array) -> None: ...
    def bind(self, traces: Any, start: Array, bodies: int) -> None: ...
    def take(
        self,
        earlier: Array,
        later: Array,
        moved_bodies: Array,
        hooked: bool,
        dt_s: float,
        gravity_m_s2: tuple[float, ...],
        time_s: float,
        newest: int,
    ) -> int: ...
    read_states: Array
    def expect_usual(self, earlier: Array, time_s: float, newest: int, body_count: Any, bodies: int) -> None: ...
    def begin_usual(self, states: StateReader) -> bool: ...
    def end_usual(self) -> int: ...
    def usual_steps(self) -> tuple[int, float, int, Array]: ...
    def taken(self) -> tuple[Array, Array, Array, Array, Array]: ...

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
def rotation_between(first: Array, second: Array, vector_rad: Array) -> None: ...
def sort_pairs(row: Array, trace: Array, sorting: Array) -> None: ...
def collect_rows(row: Array, weight_n: Array, dt_s: float, fall_m_s: float, tables: Any) -> None: ...

# runtime
STEP: np.dtype[Any]
MOBILITY: np.dtype[Any]
STEPS_DONE: int
TABLE_SHORT: int
PAUSED: int
BROKEN: int
STEP_NEW: int
STEP_RINGS: int
STOPPED_TURN: float

def limit_poles(step: Array, free: Array) -> None: ...

class RunTime:
    def __init__(self) -> None: ...
    def bind(
        self,
        *,
        window: object,
        table: object,
        pairs: object,
        supports: object,
        bank: object,
        scratch: object,
        path: object,
        poles: object,
    ) -> None: ...
    def turn_modes(self, b: int, after: Array, free: bool) -> bool: ...
    def couple_body(self, b: int, quaternion: Array) -> tuple[Array, Array, Array, Array, Array, Array, Array]: ...
    def update_poles(self, b: int, quaternion: Array, sr: float) -> None: ...
    def advance_steps(
        self,
        first: int,
        taken: int,
        pause: bool,
        resume: int,
        sr: float,
        steps: Array,
        contacts: Array,
        position: Array,
        quaternion: Array,
        teleported: Array,
        aim_m: Array,
        start: int,
        apart: bool,
        reads: Array,
        sets: Array,
        pressure: Array,
        out: Array,
    ) -> tuple[int, int]: ...
