"""What a recording adds to a sound, drawn at random, so that what is learnt from simulation holds for recordings.

    ChainSpread, generator -> draw_chain -> RecordingChain, numbers for the label
    samples (channels, n) + state -> record: response, gain -> + robot's noise -> latency, jitter -> + floor -> clip
    joint speeds -> robot_tones -> the robot's noise;  a file's samples -> looped_noise
    Material, generator -> vary_material: within its preset's spread (variation)

Domain randomisation [Tobin et al. 2017]. All depends on the chain's numbers and the sample's absolute number alone:
frames of any length give the same bits. An observation calls `record` on its frames, a data set on whole sounds.
"""

from __future__ import annotations

from dataclasses import asdict, dataclass, field
from typing import Any

import numpy as np

from sonic_bullet import _engine
from sonic_bullet.engine.path.surface.sensor_chain import response_taps, sensor_noise
from sonic_bullet.records import Array, Body, Material, SensorResponse, frozen_array
from sonic_bullet.records.arrays import require, store
from sonic_bullet.records.coerce import as_items, as_number, as_whole
from sonic_bullet.session.variation import draw_factors, vary_body

Range = tuple[float, float]
NOISE_OCTAVES_HZ = 62.5 * 2.0 ** np.arange(9)
"""Where a drawn response has its levels: octaves from 62.5 Hz to 16 kHz."""
MOST_JITTER = 3.0
"""Standard deviations of the jitter at most."""


@dataclass(frozen=True, slots=True)
class ChainSpread:
    """Ranges (low, high) that a chain is drawn from; none of them: as recorded by the simulation.

    Parameters
    ----------
    gain_db
        Uniform.
    response_db
        Standard deviation of each octave's level.
    noise_rthz
        Density of the noise floor in the channel's unit per √Hz, uniform in its logarithm; 0 to 0: none.
    latency_s, jitter_s
        Of the sound's arrival, uniform; jitter is its standard deviation from one 20 ms to the next.
    clip
        Magnitude that nothing exceeds, uniform in its logarithm; None: none.
    robot_db
        Gain of the robot's own noise, uniform.
    joint_factor
        Of the stiffness of joints that springs hold (`World.hold_joints`), uniform in its logarithm.
    """

    gain_db: Range = (0.0, 0.0)
    response_db: float = 0.0
    noise_rthz: Range = (0.0, 0.0)
    latency_s: Range = (0.0, 0.0)
    jitter_s: Range = (0.0, 0.0)
    clip: Range | None = None
    robot_db: Range = (0.0, 0.0)
    joint_factor: Range = (1.0, 1.0)

    def __post_init__(self) -> None:
        """Check the fields."""
        remedy = "give two numbers, the lower one first"
        for name in ("gain_db", "noise_rthz", "latency_s", "jitter_s", "clip", "robot_db", "joint_factor"):
            if name == "clip" and self.clip is None:
                continue
            least, most = (-200.0, 200.0) if name.endswith("_db") else (0.0, 10.0 if name.endswith("_s") else 1e12)
            pair = as_items(getattr(self, name), f"chain spread: {name}", remedy)
            low, high = (
                as_number(x, f"chain spread: {name}", remedy, least=least, most=most)
                for x in (pair if len(pair) == 2 else (None, None))
            )
            require(low <= high, f"chain spread: {name} descends", remedy)
            above = name not in ("clip", "joint_factor") or low > 0
            require(above, f"chain spread: {name} is 0", "give two numbers above 0")
            store(self, **{name: (low, high)})
        remedy = "give decibels, 0 or more"
        store(self, response_db=as_number(self.response_db, "chain spread: response_db", remedy, least=0, most=40))


@dataclass(frozen=True, slots=True, eq=False)
class RecordingChain:
    """One recording's numbers; see `ChainSpread`. levels_db (9,): of `NOISE_OCTAVES_HZ`. seed: of noise and jitter."""

    gain_db: float = 0.0
    levels_db: Array = field(default_factory=lambda: np.zeros(len(NOISE_OCTAVES_HZ)))
    noise_rthz: float = 0.0
    latency_s: float = 0.0
    jitter_s: float = 0.0
    clip: float | None = None
    robot_db: float = 0.0
    seed: int = 0
    joint_factor: float = 1.0

    def __post_init__(self) -> None:
        """Check the fields."""
        levels = frozen_array(self.levels_db, float, (len(NOISE_OCTAVES_HZ),), "recording chain: levels_db")
        seed = as_whole(self.seed, "recording chain: seed", "give a whole number, 0 or more", least=0)
        store(self, levels_db=levels, seed=seed)

    def to_json(self) -> dict[str, Any]:
        """Return the numbers for a label."""
        return asdict(self) | {"levels_db": self.levels_db.tolist()}


def draw_chain(draw: np.random.Generator, spread: ChainSpread) -> RecordingChain:
    """Draw a chain; the same numbers of the generator are used whatever the spread."""
    u, levels, seed = draw.random(6), draw.normal(size=len(NOISE_OCTAVES_HZ)), int(draw.integers(2**63))
    factor = _in_logarithm(float(draw.random()), spread.joint_factor)  # last: earlier draws are of the same numbers
    ranges = spread.gain_db, spread.latency_s, spread.jitter_s, spread.robot_db
    gain, latency, jitter, robot = (low + x * (high - low) for x, (low, high) in zip(u, ranges, strict=False))
    return RecordingChain(
        gain, spread.response_db * levels, _in_logarithm(u[4], spread.noise_rthz), latency, jitter,
        None if spread.clip is None else _in_logarithm(u[5], spread.clip), robot, seed, factor,
    )  # fmt: skip


def _in_logarithm(u: float, between: Range) -> float:
    """Draw uniformly in the logarithm; uniformly where it reaches 0."""
    low, high = between
    return float(low * (high / low) ** u if low > 0 else u * high)


@dataclass(frozen=True, slots=True, eq=False)
class RecordingState:
    """What `record` needs of the samples before: how many there were, and the last of them at two places."""

    count: int = 0
    before: Array = field(default_factory=lambda: np.zeros((0, 0)))
    filtered: Array = field(default_factory=lambda: np.zeros((0, 0)))


def record(
    samples: Array, sr: int, chain: RecordingChain, robot: Array | None = None, state: RecordingState | None = None
) -> tuple[Array, RecordingState]:
    """Return samples (channels, n) as the chain records them, and the state for those that follow.

    robot: its own noise at the same samples, (n,) or (channels, n).

    Raises
    ------
    RecordError
        A number of the samples is not finite, or robot has another length.
    """
    sound = frozen_array(samples, float, (None, None), "recorded samples")
    state = state or RecordingState()
    first, n = state.count, sound.shape[1]
    taps = _taps(chain, sr)
    held = _hold_last(state.before, len(sound), len(taps) - 1)
    signal = np.concatenate([held, sound], axis=1)
    shaped = np.zeros(sound.shape)
    _engine.filter_rows(taps, signal, shaped)
    if robot is not None:
        noise = np.broadcast_to(frozen_array(np.atleast_2d(robot), float, (None, n), "robot's noise"), shaped.shape)
        shaped = shaped + 10 ** (chain.robot_db / 20) * noise
    past = _hold_last(state.filtered, len(sound), _most_delay(chain, sr) + 4)
    late = np.concatenate([past, shaped], axis=1)
    made = _read_delayed(late, past.shape[1], first, n, sr, chain)
    for c in range(len(made)):
        if chain.noise_rthz:
            made[c] += sensor_noise(chain.noise_rthz, sr, (chain.seed, c), first, n)
    made = made if chain.clip is None else np.clip(made, -chain.clip, chain.clip)
    return made, RecordingState(first + n, signal[:, signal.shape[1] - held.shape[1] :], late[:, n:])


def _taps(chain: RecordingChain, sr: int) -> Array:
    gain = 10 ** (chain.gain_db / 20)
    if not chain.levels_db.any():
        return np.array([gain])
    return gain * response_taps(SensorResponse(NOISE_OCTAVES_HZ, 10 ** (chain.levels_db / 20)), sr)


def _hold_last(held: Array, channels: int, size: int) -> Array:
    return held if held.size else np.zeros((channels, size))


def _most_delay(chain: RecordingChain, sr: int) -> int:
    return int(np.ceil((chain.latency_s + MOST_JITTER * chain.jitter_s) * sr))


def _read_delayed(late: Array, ahead: int, first: int, n: int, sr: int, chain: RecordingChain) -> Array:
    """Read late (channels, ahead + n) at each sample's own delay, by cubic interpolation of four samples.

    Where it is no whole number of samples, all is one sample later: the fourth must be known.
    """
    # Time between two values of the jitter, linear between them: buffers of that length arrive early or late
    knot_s = 0.02
    number = np.arange(first, first + n)
    if chain.jitter_s == 0:
        if float(chain.latency_s * sr).is_integer():
            start = ahead - int(chain.latency_s * sr)
            return np.array(late[:, start : start + n])
        delay = np.full(n, chain.latency_s * sr)
    else:
        knot = number / (sr * knot_s)
        low = np.floor(knot).astype(np.int64)
        begin = int(knot[0]) if n else 0
        value = np.array([_knot(chain, k) for k in range(begin, int(low.max(initial=begin)) + 2)])
        part = knot - low
        mixed = (1 - part) * value[low - begin] + part * value[low - begin + 1]
        delay = np.maximum(chain.latency_s + chain.jitter_s * mixed, 0.0) * sr
    whole = np.floor(delay).astype(np.int64)
    t, at = delay - whole, ahead + np.arange(n) - whole - 1
    weights = (  # Lagrange, of the samples one after to two before
        -t * (t - 1) * (t - 2) / 6,
        (t + 1) * (t - 1) * (t - 2) / 2,
        -(t + 1) * t * (t - 2) / 2,
        (t + 1) * t * (t - 1) / 6,
    )  # fmt: skip
    return np.asarray(sum(w * late[:, at + 1 - k] for k, w in enumerate(weights)))


def _knot(chain: RecordingChain, number: int) -> float:
    draw = np.random.Generator(np.random.PCG64([chain.seed, 1 << 32, number]))
    return float(np.clip(draw.standard_normal(), -MOST_JITTER, MOST_JITTER))


def robot_tones(
    speed_rad_s: Array, step_s: float, sr: int, orders: Array, level_s_rad: Array, phase_rad: Array | None = None
) -> tuple[Array, Array]:
    """Make the tones of turning joints: Σ level·|speed|·sin(∫ order·speed dt), (n,), and the phases to go on from.

    Parameters
    ----------
    speed_rad_s : Array, shape (s, j)
        Of j joints at the start of each of s steps and at the last one's end: s - 1 steps of sound.
    step_s : float
        Length of a step.
    orders, level_s_rad : Array, shape (j, k)
        Of k tones of each joint: turns of the source per turn of the joint, such as teeth or gear ratio; amplitude a
        rad/s.
    phase_rad : Array, shape (j, k)
        Where they begin; None: at 0.
    """
    speed = frozen_array(speed_rad_s, float, (None, None), "speed_rad_s")
    order = frozen_array(orders, float, (speed.shape[1], None), "orders")
    level = frozen_array(level_s_rad, float, order.shape, "level_s_rad")
    require(len(speed) > 0, "speed_rad_s is empty", "give the speeds at the start and at the end of a step")
    n = round((len(speed) - 1) * step_s * sr)
    time_s = np.arange(n + 1) / sr
    at = np.stack([np.interp(time_s, np.arange(len(speed)) * step_s, one) for one in speed.T], axis=1)
    turned = np.concatenate([np.zeros((1, at.shape[1])), np.cumsum((at[1:] + at[:-1]) / (2 * sr), axis=0)])
    start = np.zeros(order.shape) if phase_rad is None else frozen_array(phase_rad, float, order.shape, "phase_rad")
    phase = start + turned[:, :, None] * order
    tone = (level * np.abs(at)[:, :, None] * np.sin(phase)).sum(axis=(1, 2))
    return tone[:n], np.mod(phase[-1], 2 * np.pi)


def looped_noise(noise: Array, first: int, count: int, seed: int) -> Array:
    """Return (count,) of recorded noise (k,) from absolute sample ``first`` on, looped, begun anywhere by the seed."""
    kept = frozen_array(noise, float, (None,), "noise")
    require(len(kept) > 0, "noise is empty", "give the samples of a recording")
    offset = int(np.random.default_rng(seed).integers(len(kept)))
    return np.asarray(kept[(offset + first + np.arange(count)) % len(kept)])


def vary_material(material: Material, draw: np.random.Generator) -> tuple[Material, dict[str, float]]:
    """Draw a material within its preset's spread; return it and the factors for the label, none of an unknown one."""
    factors = draw_factors(material, draw)
    body = vary_body(Body(0, -1, 0, "", 0.0, np.zeros((3, 3)), material=material), factors)
    assert body.material is not None
    return body.material, factors
