"""One clip: its numbers, each part drawn by a generator of its own, and the same clip with one cause changed.

rng -> a seed a part -> HouseholdClip -> parameters, the columns of the data set
HouseholdClip, cause -> HouseholdClip that differs in that cause alone
"""

from __future__ import annotations

from collections.abc import Callable, Mapping
from dataclasses import asdict, dataclass, replace
from typing import Any

import numpy as np

from sonic_bullet.apps.dataset.household.holding import FINGER_N_S_M
from sonic_bullet.apps.dataset.household.materials import CLASS_OF
from sonic_bullet.apps.dataset.household.objects import KINDS, WALLS_M, DrawnObject, draw_object
from sonic_bullet.apps.dataset.household.strikers import SPEED_M_S, STRIKERS, Striker, draw_striker
from sonic_bullet.apps.dataset.household.surroundings import (
    NOISE_DB,
    NOISE_SLOPE_DB,
    DrawnRoom,
    draw_room,
)  # fmt: skip
from sonic_bullet.options.dataset import HouseholdOptions

FREE_SUPPORTS = ("held", "hung")
SURFACES = ("cloth", "wood", "stone")
DROPPED, ROLLED, SCRAPED, SHAKEN = "dropped", "rolled", "scraped", "shaken"
EXCITATIONS = (*STRIKERS, DROPPED, ROLLED, SCRAPED, SHAKEN)
ROLLING_KINDS = ("bottle", "cup", "glass", "pipe", "tin")
"""What rolls, on its side."""
SHAKEN_KINDS = ("bowl", "box", "cup", "glass", "pan", "tin")
"""What holds something that rattles, a hand over its mouth."""
FILLINGS, MOST_PIECES = ("stick", "metal"), 6
"""Strikers whose tips are what rattles, wooden beads or metal balls, and how many there are at most."""
DROPPED_SHARE = 0.2
"""Of the clips; the others are shared by the strikers."""
SIZES = (0.7, 1.0)
"""Of a shape as it was drawn."""
HEIGHTS_M = (0.01, 0.3)
"""That things are dropped from, uniform in the logarithm."""
ROLLING_M_S, SCRAPING_M_S, SCRAPING_N, SHAKING_M_S = (0.1, 0.6), (0.05, 0.5), (0.5, 5.0), (0.4, 1.5)
"""Speeds of rolling, of a scraping tip and of a shaking hand, and how hard a tip is pressed: light to firm."""
DISTANCES_M = (0.1, 1.5)
"""From a close microphone's, a hand's breadth or two [Huber & Runstein 2010, Modern Recording Techniques, ch. 4: up to
0.9 m], to across a table."""
MOST_FINGERS = 4
STRENGTH_SCATTER, PLACE_SCATTER_M = 0.15, 0.002
"""From one take of a pair to the next: standard deviations of the logarithm of speed, height or load, and of the place
along each direction of the surface. Of a hand that aims: a strike within 1.3 dB, a fingertip's half on target."""


@dataclass(frozen=True, slots=True)
class HouseholdClip:
    """A clip that was drawn.

    Parameters
    ----------
    elastic_seed, loss_seed
        Of the specimen's stiffness and density, and of its loss.
    size
        Of the shape as drawn.
    support
        "held", "hung", or the surface that it lies on or falls onto.
    fingers_n_s_m
        Strength of each finger that holds it, N·s/m.
    excitation
        Of `EXCITATIONS`: a striker's kind, or what happens to the object.
    striker
        Also what scrapes, and the pieces in what is shaken. None: the object meets what lies below it.
    speed_m_s, height_m, load_n
        Of the striker, of rolling or of the shaking hand, of the fall, of a scraping tip; the others are 0.
    place_seed
        Of where it is struck and held, or how it is turned when dropped.
    microphone_m
        From the object's centre.
    room
        None: free air.
    noise_db, noise_slope_db
        Noise over 20 µPa, and its slope an octave; at least 20 dB below the peak.
    seed
        Of noise and microphone.
    take
        Above 0: done once more, with another noise, another strength and at another place nearby.
    pieces
        In what is shaken, as many as fit; else 0.
    """

    object: DrawnObject
    elastic_seed: int
    loss_seed: int
    size: float
    support: str
    fingers_n_s_m: tuple[float, ...]
    excitation: str
    striker: Striker | None
    speed_m_s: float
    height_m: float
    load_n: float
    place_seed: int
    microphone_m: tuple[float, float, float]
    room: DrawnRoom
    noise_db: float
    noise_slope_db: float
    seed: int
    take: int = 0
    pieces: int = 0

    def parameters(self) -> dict[str, Any]:
        """Return its numbers by name, values of JSON: every column has one type in all clips."""
        striker = None if self.striker is None else asdict(self.striker)
        return {
            "kind": self.object.kind,
            "material": self.object.material,
            "class": CLASS_OF[self.object.material],
            "wall_m": self.object.wall_m,
            "shape_seed": self.object.seed,
            "size": self.size,
            "support": self.support,
            "fingers_n_s_m": list(self.fingers_n_s_m),
            "excitation": self.excitation,
            "striker_youngs_pa": 0.0 if striker is None else striker["youngs_pa"],
            "striker_radius_m": 0.0 if striker is None else striker["radius_m"],
            "striker_mass_kg": 0.0 if striker is None else striker["mass_kg"],
            "speed_m_s": self.speed_m_s,
            "height_m": self.height_m,
            "load_n": self.load_n,
            "pieces": self.pieces,
            "microphone_m": list(self.microphone_m),
            "distance_m": float(np.linalg.norm(self.microphone_m)),
            "room_volume_m3": self.room.volume_m3,
            "room_t60_s": list(self.room.t60_s),
            "noise_db": self.noise_db,
            "noise_slope_db": self.noise_slope_db,
            "seeds": [self.elastic_seed, self.loss_seed, self.place_seed, self.room.seed, self.seed],
        }


def draw_clip(rng: np.random.Generator, options: HouseholdOptions) -> HouseholdClip:
    """Draw a clip."""
    number = int(rng.integers(options.objects or 2**62))
    own = np.random.default_rng([options.seed, 1, number])
    made_of = draw_object(own, options.kinds)
    elastic = int(own.integers(2**62))
    parts = [np.random.default_rng(int(seed)) for seed in rng.integers(2**62, size=9)]
    loss, size, support, hammer, height, place, microphone, room, noise = parts
    held = _draw_support(support)
    kind = DROPPED if hammer.random() < DROPPED_SHARE else str(hammer.choice(list(STRIKERS)))
    if options.excitations:
        kind = str(hammer.choice(options.excitations))
    below = kind in (DROPPED, ROLLED)
    if below and held in FREE_SUPPORTS:
        held = str(support.choice(SURFACES))
    held = "held" if kind == SHAKEN else held
    tips = {SCRAPED: tuple(STRIKERS), SHAKEN: FILLINGS}.get(kind, ())
    tip = kind if kind in STRIKERS else str(hammer.choice(tips)) if tips else None
    speeds = {ROLLED: ROLLING_M_S, SCRAPED: SCRAPING_M_S, SHAKEN: SHAKING_M_S}.get(kind, SPEED_M_S)
    return HouseholdClip(
        object=made_of,
        elastic_seed=elastic,
        loss_seed=int(loss.integers(2**62)),
        size=_in_logarithm(size, SIZES),
        support=held,
        fingers_n_s_m=_draw_fingers(support) if held == "held" else (),
        excitation=kind,
        striker=None if tip is None else draw_striker(hammer, tip),
        speed_m_s=0.0 if kind == DROPPED else _in_logarithm(height, speeds),
        height_m=_in_logarithm(height, HEIGHTS_M) if kind == DROPPED else 0.0,
        load_n=_in_logarithm(height, SCRAPING_N) if kind == SCRAPED else 0.0,
        place_seed=int(place.integers(2**62)),
        microphone_m=_draw_microphone(microphone),
        room=draw_room(room),
        noise_db=float(noise.uniform(*NOISE_DB)),
        noise_slope_db=float(noise.uniform(*NOISE_SLOPE_DB)),
        seed=int(noise.integers(2**62)),
        pieces=int(hammer.integers(1, MOST_PIECES + 1)) if kind == SHAKEN else 0,
    )


def draw_take(clip: HouseholdClip, take: int) -> HouseholdClip:
    """Draw how a clip goes when it is done once more by hand; take 0 is the clip itself."""
    by = float(np.exp(STRENGTH_SCATTER * np.random.default_rng([clip.seed, take]).normal())) if take else 1.0
    return replace(clip, take=take, speed_m_s=by * clip.speed_m_s, height_m=by * clip.height_m, load_n=by * clip.load_n)


def _in_logarithm(rng: np.random.Generator, between: tuple[float, float]) -> float:
    return float(np.exp(rng.uniform(*np.log(between))))


def _draw_support(rng: np.random.Generator) -> str:
    return str(rng.choice((*FREE_SUPPORTS, *SURFACES)))


def _draw_fingers(rng: np.random.Generator) -> tuple[float, ...]:
    return tuple(_in_logarithm(rng, FINGER_N_S_M) for _ in range(int(rng.integers(1, MOST_FINGERS + 1))))


def _draw_microphone(rng: np.random.Generator) -> tuple[float, float, float]:
    """Draw a place around and above."""
    turn, rise = rng.uniform(0, 2 * np.pi), rng.uniform(0.1, 0.9)
    level = np.sqrt(1 - rise**2)
    x, y, z = _in_logarithm(rng, DISTANCES_M) * np.array([level * np.cos(turn), level * np.sin(turn), rise])
    return float(x), float(y), float(z)


def _same(clip: HouseholdClip, _: np.random.Generator) -> HouseholdClip:
    return clip


def _other_material(clip: HouseholdClip, rng: np.random.Generator) -> HouseholdClip:
    others = [name for name in KINDS[clip.object.kind].materials if name != clip.object.material]
    return replace(clip, object=replace(clip.object, material=str(rng.choice(others))))


def _other_size(clip: HouseholdClip, rng: np.random.Generator) -> HouseholdClip:
    low, high = SIZES
    middle = np.sqrt(low * high)
    return replace(clip, size=_in_logarithm(rng, (low, middle) if clip.size > middle else (middle, high)))


def _other_wall(clip: HouseholdClip, rng: np.random.Generator) -> HouseholdClip:
    low, high = WALLS_M[clip.object.material]
    middle = float(np.sqrt(low * high))
    between = (low, middle) if clip.object.wall_m > middle else (middle, high)
    return replace(clip, object=replace(clip.object, wall_m=_in_logarithm(rng, between)))


def _other_hammer(clip: HouseholdClip, rng: np.random.Generator) -> HouseholdClip:
    kind = str(rng.choice([name for name in STRIKERS if name != clip.excitation]))
    return replace(clip, excitation=kind, striker=draw_striker(rng, kind))


def _other_height(clip: HouseholdClip, rng: np.random.Generator) -> HouseholdClip:
    factor = float(2.0 ** rng.choice([-1.0, 1.0]))
    return replace(clip, speed_m_s=clip.speed_m_s * factor, height_m=clip.height_m * factor)


def _other_support(clip: HouseholdClip, rng: np.random.Generator) -> HouseholdClip:
    known = SURFACES if clip.striker is None else (*FREE_SUPPORTS, *SURFACES)
    held = str(rng.choice([name for name in known if name != clip.support]))
    return replace(clip, support=held, fingers_n_s_m=_draw_fingers(rng) if held == "held" else ())


def _other_room(clip: HouseholdClip, rng: np.random.Generator) -> HouseholdClip:
    return replace(clip, room=draw_room(rng))


CAUSES: Mapping[str, Callable[[HouseholdClip, np.random.Generator], HouseholdClip]] = {
    "material": _other_material,
    "size": _other_size,
    "wall": _other_wall,
    "hammer": _other_hammer,
    "height": _other_height,
    "support": _other_support,
    "room": _other_room,
    "none": _same,
}
"""Of pairs; none: nothing but the takes' scatter."""


def draw_change(clip: HouseholdClip, rng: np.random.Generator) -> tuple[str, HouseholdClip]:
    """Draw a cause, and the clip that differs in it alone.

    What nothing strikes has no hammer, and what is shaken is held.
    """
    without = {"hammer"} if clip.excitation not in STRIKERS else set()
    without |= {"support"} if clip.excitation == SHAKEN else set()
    cause = str(rng.choice([name for name in CAUSES if name not in without]))
    return cause, CAUSES[cause](clip, rng)
