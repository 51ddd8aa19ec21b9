"""Do decays of one object on two fixtures differ as the law of contacts says?

A mug and a holder, struck by a hammer and by a robot; neither shape nor support is known, so trends alone.

    python studies/two_fixtures.py --data ../shared/measured

measured   T60 of lines that both sets have, medians over takes: by how many dB the decays differ, and whether that goes
           with frequency (Spearman's rank correlation)
law        PyBullet's mug as a stand-in, of porcelain and of wood at 1.6 times the size, upright on a wooden board: the
           same numbers, its decays in place over those in air
errors     of "decays are unchanged", and of the law's median over the stand-in's modes within half an octave, the sign
           the better of both, since nobody says which fixture is the softer
"""

from __future__ import annotations

import argparse
import json
import sys
from collections.abc import Iterator
from pathlib import Path

import numpy as np

sys.path.insert(0, str(Path(__file__).resolve().parents[1]))


import sonic_bullet as sb
from sonic_bullet.engine.contact.load_splitting import SPAN
from sonic_bullet.records import Array
from sonic_bullet.simulators import direct_client, disconnect

NEAR = 0.006
"""Of a frequency: lines nearer than this are one."""
OBJECTS = {"ceramic-mug": ("ceramic", "porcelain", 1.0), "wood-holder": ("wood", "wood", 1.6)}
LEAST_R2, LEAST_DB = 0.95, 20.0
"""Of a line's decay: how straight it falls, and over how much."""
OCTAVES = 0.5


def lines(takes: list[list[dict[str, float]]]) -> tuple[Array, Array]:
    """Frequency in Hz and T60 in s of lines that two takes have, medians."""
    rows = [
        (x["f_hz"], x["t60_s"])
        for take in takes
        for x in take
        if x.get("t60_s") and x.get("r2", 0) >= LEAST_R2 and x.get("range_db", 0) >= LEAST_DB
    ]
    found = np.array(sorted(rows))
    groups = np.split(found, np.flatnonzero(np.diff(np.log(found[:, 0])) > NEAR / 2) + 1)
    medians = np.array([np.median(group, axis=0) for group in groups if len(group) >= 2]).reshape(-1, 2)
    return medians[:, 0], medians[:, 1]


def both(data: Path, thing: str) -> tuple[Array, Array]:
    """Frequencies, and decays under the hammer over those under the robot in dB, of common lines."""
    robot = json.loads((data / "diffimpact-robot" / "case.json").read_text())["files"]
    hammer = json.loads((data / "diffimpact-hammer" / "case.json").read_text())["files"]
    f, t = lines([one["modes"] for one in robot if one["object"] == thing])
    entry = next(one for one in hammer if Path(one["file"]).name.startswith(OBJECTS[thing][0]))
    g, u = lines([hit["modes"] for hit in entry["hits"]])
    near = np.abs(np.log(f[:, None] / g)).argmin(axis=1)
    common = np.abs(np.log(f / g[near])) < NEAR
    return f[common], 20 * np.log10(t / u[near])[common]


def stand_in(material: str, scale: float) -> tuple[Array, Array]:
    """Frequencies, and decays in place over those in air in dB, of the mug upright on a board."""
    import pybullet_data

    client = direct_client()
    client.setGravity(0, 0, -9.81)
    client.setAdditionalSearchPath(pybullet_data.getDataPath())
    board = client.createCollisionShape(client.GEOM_BOX, halfExtents=[0.3, 0.2, 0.012])
    table = client.createMultiBody(0, board, basePosition=[0, 0, -0.012])
    mug = client.loadURDF("objects/mug.urdf", [0, 0, 0.2], globalScaling=scale)
    client.changeDynamics(mug, -1, mass=0.35, localInertiaDiagonal=[5e-4] * 3)  # the file says 1 kg and 1 kg m2
    lowest = client.getAABB(mug)[0][2]
    client.resetBasePositionAndOrientation(mug, [0, 0, 0.203 - lowest], [0, 0, 0, 1])
    listener = sb.attach(client)
    listener.add_all({table: {"material": "wood", "count": 60}, mug: material})
    for _ in range(240):
        client.stepSimulation()
    state = listener._synth._state
    b = next(i for i, one in enumerate(state.resonators) if one.body.mass_kg > 0)
    load_n, _, _, decay_per_s, *_ = state.engine().couple_body(
        b, state.window.quaternion_xyzw[(state.number - 1) % SPAN]
    )
    assert len(load_n), "it does not stand"
    one = state.resonators[b]
    disconnect(client)
    return one.omega_rad_s / 2 / np.pi, 20 * np.log10(decay_per_s / one.decay_per_s)


def rank_correlation(x: Array, y: Array) -> tuple[float, float]:
    from scipy.stats import spearmanr

    found = spearmanr(x, y)
    return float(found.statistic), float(found.pvalue)


def law_at(f: Array, law: tuple[Array, Array]) -> Array:
    """The law's median over modes near each frequency."""
    near = np.abs(np.log2(f[:, None] / law[0])) < OCTAVES
    return np.array([np.median(law[1][row]) if row.any() else 0.0 for row in near])


def report(data: Path) -> Iterator[str]:
    for thing, (_, material, scale) in OBJECTS.items():
        f, change = both(data, thing)
        law = stand_in(material, scale)
        yield (
            f"{thing}: {len(f)} lines in common, {f.min():.0f} … {f.max():.0f} Hz; decays differ by "
            f"{quartiles(change)} dB (quartiles), |dB| with frequency: rank correlation "
            f"{words(rank_correlation(f, np.abs(change)))}"
        )
        yield (
            f"    law, {len(law[0])} modes of a stand-in of {material}, {law[0].min():.0f} Hz and up: "
            f"{quartiles(law[1])} dB, with frequency {words(rank_correlation(*law))}"
        )
        says = law_at(f, law)
        errors = [float(np.median(np.abs(change - sign * says))) for sign in (0, 1, -1)]
        yield f"    median |error|: unchanged {errors[0]:.1f} dB, law {min(errors[1:]):.1f} dB"
        for hz, db, said in zip(f, change, says, strict=True):
            yield f"        {hz:7.0f} Hz {db:+6.1f} dB, law {said:.1f}"


def quartiles(x: Array) -> str:
    return ", ".join(f"{value:+.1f}" for value in np.quantile(x, (0.25, 0.5, 0.75)))


def words(found: tuple[float, float]) -> str:
    return f"{found[0]:+.2f} (p {found[1]:.2f})"


def main() -> int:
    parser = argparse.ArgumentParser(description=(__doc__ or "").split("\n", maxsplit=1)[0])
    parser.add_argument("--data", type=Path, required=True, help="the folder that holds both sets")
    data = parser.parse_args().data
    if not (data / "diffimpact-robot" / "case.json").is_file():
        print(f"{data}: no diffimpact-robot there: not run", file=sys.stderr)
        return 2
    for line in report(data):
        print(line, flush=True)
    return 0


if __name__ == "__main__":
    raise SystemExit(main())
