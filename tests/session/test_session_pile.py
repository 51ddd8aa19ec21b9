"""Twenty bodies fall into a walled box: every impact is heard, and when they rest there is silence."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, replace
from typing import Any

import numpy as np
import pybullet as p
import pytest

import sonic_bullet as sb
from sonic_bullet.engine.contact.load_splitting import LOOKAHEAD
from sonic_bullet.engine.runtime.replay import Synthesizer
from sonic_bullet.engine.runtime.synthesis_state import Setup, State, start, with_bodies
from sonic_bullet.engine.runtime.synthesizer import advance
from sonic_bullet.files.contact_log import ContactLog
from sonic_bullet.records import Body, Microphone, ModalSum
from sonic_bullet.simulators import direct_client, disconnect
from tests.made.models import GLASS, STEEL, WOOD, ball_body, box_model
from tests.made.stages import Stages

STRIKE_N_S = 1e-3
DT = 1 / 240
SECONDS = 2.9
SR = 16_000


def walled_box(client: Any) -> list[int]:
    planks = [
        ([0.3, 0.3, 0.02], [0, 0, -0.02]),
        *(([0.02, 0.3, 0.3], [x, 0, 0.3]) for x in (-0.2, 0.2)),
        *(([0.3, 0.02, 0.3], [0, y, 0.3]) for y in (-0.2, 0.2)),
    ]
    made = [
        client.createMultiBody(0, client.createCollisionShape(p.GEOM_BOX, halfExtents=half), basePosition=where)
        for half, where in planks
    ]
    for plank in made:
        client.changeDynamics(plank, -1, restitution=0.3, contactProcessingThreshold=0)
    return made


def thrown_in(client: Any, listener: sb.Listener, number: int, rng: np.random.Generator) -> int:
    material = (STEEL, WOOD, GLASS)[number % 3]
    position = [*rng.uniform(-0.1, 0.1, 2), 0.12 + 0.09 * number]
    turn = p.getQuaternionFromEuler(list(rng.uniform(-1, 1, 3)))
    if number % 4 == 3:
        shape, model, mass = (
            client.createCollisionShape(p.GEOM_SPHERE, radius=0.025),
            ball_body(0.025, material).model,
            0.15,
        )
    elif number % 4 == 2:
        shape, mass = client.createCollisionShape(p.GEOM_CYLINDER, radius=0.025, height=0.06), 0.12
        model = box_model((0.05, 0.05, 0.06), (1900.0 + 70 * number, 4100.0), material, seed=number)
    else:
        edges = (0.07, 0.05, 0.03 + 0.01 * (number % 3))
        shape, mass = client.createCollisionShape(p.GEOM_BOX, halfExtents=[e / 2 for e in edges]), 0.1 + 0.02 * number
        model = box_model(edges, (800.0 + 50 * number, 2100.0, 3300.0 + 40 * number), material, seed=number)
    body = client.createMultiBody(mass, shape, basePosition=position, baseOrientation=turn)
    client.changeDynamics(
        body, -1, restitution=0.3, contactProcessingThreshold=0, rollingFriction=1e-3, spinningFriction=1e-3
    )
    listener.add(body, material=material, model=model)
    return int(body)


@dataclass(frozen=True)
class Pile:
    """pulses: (step, pair, impulse in N·s) of each, in which it began."""

    log: ContactLog
    sound: np.ndarray
    pulses: list[tuple[int, int, float]]


@pytest.fixture(scope="module")
def pile() -> Any:
    client = direct_client()
    client.setGravity(0, 0, -9.81)
    walled_box(client)
    listener = sb.attach(client, sr=SR, microphone=[Microphone([0, -0.6, 0.5]), ModalSum()], seed=1)
    rng = np.random.default_rng(4)
    for number in range(20):
        thrown_in(client, listener, number, rng)
    for _ in range(round(SECONDS / DT)):
        client.stepSimulation()
    yield Pile(listener.contacts, listener.sound(), pulses(listener.contacts))
    disconnect(client)


def pulses(log: ContactLog) -> list[tuple[int, int, float]]:
    """(step, pair, impulse) of all that the run time makes of the log."""
    stages, begun = Stages(log.bodies, pairs=300), []
    for number, step in enumerate(log.steps):
        for pulse in stages.take(step)[0]:
            low, high = (int(body) for body in pulse["body"])
            impulse = float(np.linalg.norm(pulse["impulse_n_s"]))
            begun.append((number - LOOKAHEAD + int(pulse["ahead"]), (low << 16) | high, impulse))
    return begun


def impacts(log: ContactLog) -> list[tuple[int, int, float]]:
    """(step, pair, impulse) of what any user would call an impact, from the rows alone: a pair that touched nothing for
    four steps meets at more than 5 cm/s, and its impulse, less what it carries afterwards, is above 1 mN·s."""
    loads: dict[int, np.ndarray] = {}
    speed: dict[int, np.ndarray] = {}
    for number, step in enumerate(log.steps):
        rows = step.contacts
        for a, b, push, fast in zip(
            rows.a, rows.b, np.einsum("ki,ki->k", rows.impulse_n_s, rows.normal), rows.approach_m_s, strict=True
        ):
            key = (min(a, b) << 16) | max(a, b)
            loads.setdefault(key, np.zeros(len(log.steps) + 4))[number] += push
            speed.setdefault(key, np.zeros(len(log.steps) + 4))
            speed[key][number] = max(speed[key][number], fast)
    found = []
    for key, load in loads.items():
        for number in np.flatnonzero(load[:-4] > 0):
            if number >= 4 and not load[number - 4 : number].any() and speed[key][number] > 0.05:
                excess = load[number : number + 3].sum() - 3 * load[number : number + 4].min()
                if excess > STRIKE_N_S:
                    found.append((int(number), int(key), float(excess)))
    return sorted(found)


def last_strike_s(log: ContactLog) -> float:
    """End of the last step in which any pair's load jumps by more than 1 mN·s in a step at an approach above 5 cm/s."""
    last = 0
    before: dict[tuple[int, int], float] = {}
    for number, step in enumerate(log.steps):
        rows = step.contacts
        now: dict[tuple[int, int], float] = {}
        fast: dict[tuple[int, int], float] = {}
        for a, b, push, speed in zip(
            rows.a, rows.b, np.einsum("ki,ki->k", rows.impulse_n_s, rows.normal), rows.approach_m_s, strict=True
        ):
            pair = (min(a, b), max(a, b))
            now[pair] = now.get(pair, 0.0) + push
            fast[pair] = max(fast.get(pair, 0.0), speed)
        if any(push - before.get(pair, 0.0) > STRIKE_N_S and fast[pair] > 0.05 for pair, push in now.items()):
            last = number
        before = now
    return (last + 1) * DT


def replayed(log: ContactLog, quench_s: float) -> np.ndarray:
    """The log's sound with the bank silenced once, at the time given."""
    synth = Synthesizer(sr=log.sr, sensors=log.sensors, seed=log.seed, air=log.air)
    for number, step in enumerate(log.steps):
        if number == round(quench_s / DT):
            synth.quench()
        synth.feed(step, log.bodies[: len(step.position_m)])
    return synth.sound()


@pytest.mark.slow
def test_a_settled_pile_is_silent(pile: Pile) -> None:
    """What follows a quench one second after the last strike stays 100 dB below the loudest moment."""
    last = last_strike_s(pile.log)
    assert 0.5 < last < 3.5, f"the pile came to rest after {last} s: choose another seed"
    sound = replayed(pile.log, last + 1.0)
    after = sound[:, round((last + 1.0) * SR) :]
    level = 20 * np.log10(np.maximum(np.abs(after).max(axis=1), 1e-30) / np.abs(sound).max(axis=1))
    print(f"last strike at {last:.2f} s; loudest {np.abs(sound).max(axis=1)}; after: {level} dB")
    assert (level < -100).all()


def test_a_settled_pile_rings_out_with_nothing_but_decay(pile: Pile) -> None:
    """Without a quench: from one second after the last strike no pulse begins, and energy falls from each fifth of a
    second to the next.
    """
    begin = last_strike_s(pile.log) + 1.0
    assert not [pulse for pulse in pile.pulses if pulse[0] >= begin / DT]
    tail = pile.sound[:, round(begin * SR) :]
    block = SR // 5
    energy = (tail[:, : tail.shape[1] // block * block].reshape(len(tail), -1, block) ** 2).sum(axis=2)
    assert energy.shape[1] >= 3
    assert (energy[:, 1:] < energy[:, :-1]).all()


def test_every_impact_is_a_pulse(pile: Pile) -> None:
    """Each impact of the log is a pulse of the same pair within two steps, itself above 1 mN·s, but for bounces that
    the step's length makes of who comes to rest: under 1 % of all impulse.
    """
    wanted = impacts(pile.log)
    assert len(wanted) > 40
    missed, share = [], []
    for number, key, impulse in wanted:
        mine = sum(j for at, pair, j in pile.pulses if pair == key and abs(at - number) <= 2)
        share.append(mine / impulse)
        if mine < STRIKE_N_S:
            missed.append((number, key >> 16, key & 0xFFFF, impulse, mine))
    print(
        f"{len(wanted)} impacts, {len(pile.pulses)} pulses, missed {missed}; share of the impulse: median "
        f"{np.median(share):.2f}, least {min(share):.2f}"
    )
    assert sum(one[3] for one in missed) < 0.01 * sum(impulse for _, _, impulse in wanted)
    assert np.median(share) == pytest.approx(1.0, abs=0.1)


def played(setup: Setup, state: State, bodies: tuple[Body, ...], steps: Sequence[sb.Step]) -> np.ndarray:
    """Frames (channels, n) of the steps three before those, which are fed; the state moves on."""
    frames = [np.zeros((len(setup.sensors), 0))]
    for step in steps:
        known = len(state.resonators)
        if len(step.position_m) > known:
            new = bodies[known : len(step.position_m)]
            with_bodies(setup, state, new, step.position_m[known:], step.quaternion_xyzw[known:])
        frames.append(advance(setup, state, [step]))
    return np.concatenate(frames, axis=1)


def parted(step: sb.Step, key: int) -> sb.Step:
    """The step as if that pair did not touch."""
    row = step.contacts.row
    pair = (np.minimum(row["a"], row["b"]) << 16) | np.maximum(row["a"], row["b"])
    return replace(step, contacts=sb.Contacts.of(row[pair != key]))


@pytest.mark.slow
def test_every_impact_is_an_onset_in_the_sound(pile: Pile) -> None:
    """At the microphone: without the pair's contacts the sound is the same to the bit until an impact, and another from
    then on.

    From then on means from one step before the impact's (where bodies overlap as a step starts, they met in the one
    before) to its end and 3 ms of travel. How far an impact stands out of what rings already is physics: printed, and
    half of them are the loudest thing in some band.
    """
    log = pile.log
    setup = Setup(log.sr, log.sensors, log.seed, log.air)
    state, at = start(setup), 0
    wanted = impacts(log)
    begins, above_db = [], []
    for number, key, _ in wanted:
        played(setup, state, log.bodies, log.steps[at:number])
        at = number
        steps = [parted(step, key) for step in log.steps[number : number + 7]]
        without = played(setup, state.copy(), log.bodies, steps)
        first = int(np.floor((number - 3) * SR * DT + 1e-9))
        both = np.stack([pile.sound[0, first : first + without.shape[1]], without[0, : pile.sound.shape[1] - first]])
        changed = np.flatnonzero(both[0] != both[1])
        assert len(changed), f"step {number}: no difference"
        begins.append((first + changed[0]) / SR / DT - number)
        window = slice(changed[0], changed[0] + 160)
        impact, rest = np.abs(np.fft.rfft(np.hanning(160) * np.stack([both[0] - both[1], both[1]])[:, window], 512))
        above_db.append(20 * np.log10(np.max(impact / np.maximum(rest, 1e-30))))
    print(f"{len(wanted)} impacts begin {min(begins):.2f} … {max(begins):.2f} steps after their step's start")
    print(
        f"the impact over the rest, in the band where it is most: median {np.median(above_db):.1f} dB, a tenth "
        f"below {np.percentile(above_db, 10):.1f} dB"
    )
    assert len(wanted) > 40
    assert min(begins) >= -1
    assert max(begins) <= 1 + 3e-3 / DT
    assert np.median(above_db) > 0


def test_zeroing_the_bank_alone_changes_nothing_that_is_struck_later(pile: Pile) -> None:
    """A quench before the first strike is no change at all."""
    log = replace(pile.log, steps=pile.log.steps[:60])
    np.testing.assert_array_equal(replayed(log, 0.05), sb.render_log(log))
