"""One strike of a baked body, as the run time's bank plays it: the reference for every format.

    F(t) = J π/2τ sin(πt/τ),  0 < t < τ            half-sine pulse, as impulses at nodes u_j = (j + ½)/c
        c cells a sample: two, or as many as give the pulse 24 [src/bank/strike_pool.hpp]
    z(n) = Σ_{u_j ≤ n} (1 + i d/ω) φ(p)·j J_j e^{(-d + iω)(n - u_j)},   n in samples
    p(n) = Re Σ pressure·(z - y)                          at 1 m, in Pa
        y(n): the force's part in n - ½ … n + ½, of Σ_n z    so Σ p = 0: what lasts sends nothing [src/bank/bank.hpp]

It has no travel time, no click of the rigid body and no residual: the modes alone, mean over directions.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from sonic_bullet._engine import NODES_PER_PULSE, NODES_PER_SAMPLE, SHORTEST_PULSE
from sonic_bullet.apps.bake.baked_model import BakedModel
from sonic_bullet.apps.bake.mode_importance import SLOWEST_PER_S
from sonic_bullet.engine.bank import audible
from sonic_bullet.geometry import closest_point
from sonic_bullet.radiation.far_field import radiation
from sonic_bullet.records import Air, Array, ModalModel, frozen_array
from sonic_bullet.records.arrays import require, store
from sonic_bullet.records.coerce import as_number, as_whole
from sonic_bullet.records.errors import ModalError

# a strike without given impulse and length: a light tap, as long as steel on steel
TAP_IMPULSE_N_S = 0.01
TAP_CONTACT_S = 1e-4
LONGEST_CONTACT_S = 0.05


@dataclass(frozen=True, slots=True, eq=False)
class BakedStrike:
    """One strike. Raises RecordError.

    Attributes
    ----------
    point_m : (3,)
        Where, on the surface.
    impulse_n_s : (3,)
        Impulse on the body.
    contact_s
        Length of the pulse; 0: all at once.
    """

    point_m: Array
    impulse_n_s: Array
    contact_s: float = TAP_CONTACT_S

    def __post_init__(self) -> None:
        """Check the numbers."""
        remedy = f"give 0 to {LONGEST_CONTACT_S} s"
        store(
            self,
            point_m=frozen_array(self.point_m, float, (3,), "point_m"),
            impulse_n_s=frozen_array(self.impulse_n_s, float, (3,), "impulse_n_s"),
            contact_s=as_number(self.contact_s, "contact_s", remedy, least=0, most=LONGEST_CONTACT_S),
        )
        require(bool(self.impulse_n_s.any()), "a strike without impulse", "give one above zero")


def choose_strike(
    model: BakedModel,
    *,
    point_m: Array | None = None,
    direction: Array | None = None,
    impulse_n_s: float = TAP_IMPULSE_N_S,
    contact_s: float = TAP_CONTACT_S,
) -> BakedStrike:
    """Make a strike, with defaults for what is not given.

    Parameters
    ----------
    model : BakedModel
    point_m : (3,) array, optional
        Where, in m. None: at the point where it is loudest.
    direction : (3,) array, optional
        Of the impulse. None: into the surface.
    impulse_n_s : float
        Its size.
    contact_s : float
        Length of the pulse.

    Raises
    ------
    RecordError
    """
    normal = point_normals(model)
    if point_m is None:
        along = np.einsum("px,pxm->pm", normal, model.shape.astype(float))
        decay = np.maximum(model.decay_per_s, SLOWEST_PER_S)
        point = int(np.argmax(along**2 @ (np.abs(pressure_of(model)) ** 2 / decay)))
        point_m = model.point_m[point]
    point_m = frozen_array(point_m, float, (3,), "the place of a strike")
    if direction is None:
        direction = -normal[int(np.argmin(np.linalg.norm(model.point_m - point_m, axis=1)))]
    direction = frozen_array(direction, float, (3,), "the direction of a strike")
    size = float(np.linalg.norm(direction))
    require(size > 0, "the direction of a strike is none", "give a vector of some length")
    impulse = as_number(impulse_n_s, "impulse", "give an impulse above zero, in N·s", above=0)
    return BakedStrike(point_m, impulse * direction / size, contact_s)


def point_normals(model: BakedModel) -> Array:
    """Compute outward unit normals (p, 3): means of the triangles around each point, by area [Gouraud 1971].

    Along x where no triangle has a point.
    """
    total = np.zeros((len(model.point_m), 3))
    corner = model.point_m[model.face]
    vector = np.cross(corner[:, 1] - corner[:, 0], corner[:, 2] - corner[:, 0])
    for k in range(3):
        np.add.at(total, model.face[:, k], vector)
    length = np.linalg.norm(total, axis=1, keepdims=True)
    return np.where(length > 0, total / np.where(length > 0, length, 1), [1.0, 0.0, 0.0])


def pressure_of(model: BakedModel) -> Array:
    """Return the model's pressure (m,) at 1 m; where its file has none, compute it from its surface of points.

    Raises ModalError.
    """
    if model.pressure_pa_m is not None:
        return model.pressure_pa_m
    if not len(model.face):
        raise ModalError(
            f"{model.name} says neither how it radiates nor how its points hang together",
            "bake it with its pressure, or with triangles (indices)",
        )

    order = np.argsort(model.freq_hz, kind="stable")
    solved = ModalModel(
        model.freq_hz[order],
        model.decay_per_s[order],
        model.shape[:, :, order],
        model.point_m,
        model.face,
        np.zeros(len(model.face)),
        0.0,
        0.0,
    )
    pressure = np.empty(model.mode_count, complex)
    pressure[order] = radiation(solved, Air())[0]
    return pressure


def shape_at(model: BakedModel, point_m: Array) -> Array:
    """Interpolate shapes (3, m) at a place in the nearest triangle, else return the nearest point's."""
    if not len(model.face):
        return np.asarray(model.shape[int(np.argmin(np.linalg.norm(model.point_m - point_m, axis=1)))], float)
    face, weight, _ = closest_point(model.point_m, model.face, np.asarray(point_m, float)[None])
    return np.asarray(np.einsum("c,cxm->xm", weight[0], model.shape[model.face[face[0]]].astype(float)))


def render_strike(model: BakedModel, strike: BakedStrike, sr: int = 48_000, seconds: float = 2.0) -> Array:
    """Render the pressure of one strike at 1 m.

    Parameters
    ----------
    model : BakedModel
    strike : BakedStrike
        It begins at the first sample.
    sr : int
        Sample rate; modes at or above half of it are left out.
    seconds : float
        How long.

    Returns
    -------
    (n,) array
        In pascals, of the modes alone, mean over directions.

    Raises
    ------
    ModalError, RecordError
    """
    rate = as_whole(sr, "sr", "give a sample rate in Hz", least=1, most=10_000_000)
    count = round(as_number(seconds, "seconds", "give a length above zero", above=0, most=3600) * rate)
    omega = 2 * np.pi * model.freq_hz
    keep = audible(omega, model.decay_per_s, rate)
    omega, decay = omega[keep], model.decay_per_s[keep]
    gain = strike.impulse_n_s @ shape_at(model, strike.point_m)[:, keep]
    amplitude = pressure_of(model)[keep] * (1 + 1j * decay / omega) * gain
    step = (-decay + 1j * omega) / rate
    node, weight = pulse_nodes(strike.contact_s * rate)
    whole = (amplitude * (weight @ np.exp(np.multiply.outer(np.ceil(node) - node, step))) / (1 - np.exp(step))).real
    out = np.zeros(count)
    z, turn, done = np.zeros(len(step), complex), np.exp(step), 0
    during = min(int(np.ceil(node[-1])) + 1, count)
    for n in range(during):
        z = z * turn
        until = int(np.searchsorted(node, n, side="right"))
        for j in range(done, until):
            z = z + weight[j] * amplitude * np.exp(step * (n - node[j]))
        done = until
        out[n] = z.real.sum()
    out[:during] -= whole.sum() * pulse_parts(strike.contact_s * rate, during)
    played_block = 256
    starts = np.arange(during, count, played_block) - (during - 1)
    free = np.exp(np.multiply.outer(starts, step)) * z
    tail = (free @ np.exp(np.multiply.outer(step, np.arange(played_block)))).real.ravel()
    out[during:] = tail[: count - during]
    return out


def pulse_parts(length: float, count: int) -> Array:
    """Compute the part of a pulse of ``length`` samples that acts within half a sample of each of ``count``."""
    edge = np.arange(count + 1) - 0.5
    return np.diff(0.5 - 0.5 * np.cos(np.pi * np.clip(edge / max(length, SHORTEST_PULSE), 0, 1)))


def pulse_nodes(length: float) -> tuple[Array, Array]:
    """Compute node times (N,) in samples from the start and impulse fractions (N,) of a pulse of ``length`` samples.

    By the module's first equation.
    """
    length = max(length, SHORTEST_PULSE)
    cells = max(NODES_PER_SAMPLE, int(np.ceil(NODES_PER_PULSE / length)))
    node = (np.arange(int(np.ceil(cells * length))) + 0.5) / cells
    force = np.maximum(np.sin(np.pi * node / length), 0.0)
    return node, force / force.sum()
