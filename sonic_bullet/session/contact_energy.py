"""How much of its contacts a body can make sound of, at most, from a log alone: who is solved, and in which order.

    contact rows -> work of impacts and of friction (b,) -> bodies that touch share it -> joules a body

An impulse J between surfaces that close at v does work of at most J v on what rings [Newton; a blow that is not elastic
does half], friction at most the tangential impulse times the speed of the slide. What rests closes no faster than a
step's fall and does none (engine.contact.load_splitting). Vibration passes through contacts, so bodies that touch
are judged together.

    p² T = ρc E/4πr² < (20 µPa)² · 1 s: inaudible, even if all of it left as sound    [Pierce 1989, eq. 1-11.4]
"""

from __future__ import annotations

from collections.abc import Iterable

import numpy as np

from sonic_bullet.engine.contact.load_splitting import SLIDES_M_S, settling_m_s
from sonic_bullet.files.rows.log_steps import StepBlock
from sonic_bullet.geometry import label_components
from sonic_bullet.records import Air, Array
from sonic_bullet.records.units import REFERENCE_PRESSURE_PA

NEAREST_M = 0.1
"""Distance at which a body is judged: a microphone that a later render of its log brings nearer hears the body itself
through its near field."""


def inaudible_j(air: Air) -> float:
    """Return the energy that is not heard at `NEAREST_M`, even if all of it is radiated within a second."""
    square = REFERENCE_PRESSURE_PA**2
    return float(4 * np.pi * NEAREST_M**2 * square / (air.density_kg_m3 * air.sound_speed_m_s))


def contact_work_j(blocks: Iterable[StepBlock], bodies: int) -> tuple[Array, Array]:
    """Compute the work (b,) of each body's contacts, and the pairs (p, 2) that touched."""
    work = np.zeros(bodies)
    pairs = [np.zeros(0, np.int64)]
    for block in blocks:
        row = block.contact
        step = np.repeat(np.arange(len(block.step)), block.counts("contact"))
        fall = (block.step["gravity_m_s2"] * block.step["dt_s"][:, None])[step]
        along = np.einsum("ki,ki->k", row["impulse_n_s"], row["normal"])
        across = np.linalg.norm(row["impulse_n_s"] - along[:, None] * row["normal"], axis=1)
        sweep = row["sweep_m_s"].max(axis=1, initial=0.0)
        done = np.where(
            row["approach_m_s"] > settling_m_s(fall, row["normal"]), np.abs(along) * row["approach_m_s"], 0.0
        )
        done += np.where(sweep > SLIDES_M_S, (across + np.abs(along)) * sweep, 0.0)
        for side in ("a", "b"):
            work += np.bincount(row[side], done, bodies)
        pairs.append(np.unique(row["a"].astype(np.int64) * bodies + row["b"]))
    key = np.unique(np.concatenate(pairs))
    return work, np.stack([key // max(bodies, 1), key % max(bodies, 1)], axis=1)


def shared_work_j(work: Array, pairs: Array, rings: Array) -> Array:
    """Give each of the bodies (b,) that ring the work of all that it touches, directly or through others that ring."""
    joined = pairs[rings[pairs].all(axis=1)]
    label = label_components(len(work), joined[:, 0], joined[:, 1])
    return np.asarray(np.bincount(label, np.where(rings, work, 0.0))[label])
