"""Friction of a step on the tables: what moves has a drive, what rests costs nothing, gains and directions follow."""

from __future__ import annotations

from types import SimpleNamespace

import numpy as np
import pytest

from sonic_bullet._engine import CONTACT_PATCH, FOLLOW_S, SPAN, advance_friction
from sonic_bullet.engine.runtime.channels.body_images import BodyImages
from sonic_bullet.engine.runtime.synthesis_state import TouchingPairs, Window
from sonic_bullet.engine.runtime.tables import BODY, FACE, NODE, PAIR, ROW, TURN, WINDOW, StepScratch
from sonic_bullet.records import Array

SR, N, DT_S = 48000, 200, 1 / 240
COLUMNS = 3


class Table:
    """A box (body 1) on a board that does not move (body 0), each with a triangle and three modes."""

    def __init__(self) -> None:
        self.pairs, self.gain = np.zeros(2, PAIR), np.full((2, 2, COLUMNS), np.nan)
        self.pairs["body"], self.pairs["key"] = (0, 1), 1
        self.bodies = np.zeros(2, BODY)
        self.bodies["mass_kg"], self.bodies["inertia_kg_m2"] = (0, 0.5), np.eye(3) * 1e-3
        self.bodies["modulus_pa"], self.bodies["restitution"] = 1e10, 0.5
        self.bodies["roughness_m"], self.bodies["hurst"], self.bodies["surface_seed"] = 2e-6, 0.75, (11, 12)
        self.bodies["octave_rms_m"] = -1.0
        self.bodies["size_m"], self.bodies["volume_m3"], self.bodies["curvature_per_m"] = 0.1, 1e-3, 20.0
        self.bodies["modes"], self.bodies["columns"], self.bodies["faces"] = COLUMNS, COLUMNS, 1
        self.bodies["shape_at"] = 0, 9 * COLUMNS
        self.faces, self.nodes = np.zeros(1, FACE), np.zeros(1, NODE)
        self.faces["vertex"], self.nodes["child"] = (0, 1, 2), (-1, 1)
        self.shapes = np.random.default_rng(4).normal(size=18 * COLUMNS).astype(np.float32)

    def row(self, sweep_m_s: tuple[float, float], friction: float, load_n: float, corner: int = 0) -> Array:
        """The contact in the step that follows."""
        rows = np.zeros(1, ROW)
        rows["key"], rows["body"], rows["normal"] = 1, (0, 1), (0, 0, -1)
        impulse = np.array([friction * load_n, 0, -load_n]) * DT_S
        rows["impulse_n_s"], rows["load_n_s"], rows["sweep_m_s"] = impulse, load_n * DT_S, sweep_m_s
        rows["local_impulse_n_s"] = impulse, -impulse
        rows["touched"], rows["curvature_per_m"] = 1, 20.0
        rows["barycentric"][:, :, corner] = 1.0
        return rows

    def step(self, rows: Array, support_n: tuple[float, float]) -> dict[str, Array]:
        """The drives of a step."""
        self.pairs["support_n"][0] = support_n
        out = {
            "force": np.zeros(N),
            "gain0": np.zeros((1, 2, COLUMNS)),
            "gain1": np.zeros((1, 2, COLUMNS)),
            "direction0": np.zeros((1, 3)),
            "direction1": np.zeros((1, 3)),
            "body": np.zeros((1, 2), np.int64),
            "slot": np.zeros(1, np.int64),
        }
        window = Window(
            np.zeros(SPAN, WINDOW), np.zeros((SPAN, 2, 3)), np.tile([0, 0, 0, 1.0], (SPAN, 2, 1)),
            np.zeros((SPAN, 2), bool), rows,
        )  # fmt: skip
        window.step["dt_s"], window.step["row"] = DT_S, (0, len(rows))
        table = SimpleNamespace(
            bodies=self.bodies,
            faces=self.faces,
            nodes=self.nodes,
            shapes=self.shapes,
            turns=np.zeros(0, TURN),
            frequency_hz=np.zeros(0),
            spectrum=np.zeros((2, 0)),
            tracks=np.zeros(0),
        )
        pairs = TouchingPairs(
            self.pairs,
            np.zeros(1, np.int64),
            np.array([1, 0]),
            np.zeros(0, np.int64),
            self.gain,
            np.zeros(2, CONTACT_PATCH),
        )
        scratch = StepScratch(**out)
        advance_friction(0, np.arange(N) / N, float(SR), (window, BodyImages()), table, pairs, scratch)
        out["force"] = out["force"].reshape(1, N)
        return {name: values[: scratch.count[1]] for name, values in out.items()}


@pytest.mark.slow
def test_what_rests_has_no_drive_and_no_triangle_is_looked_up_for_it() -> None:
    table = Table()
    table.step(table.row((0.0, 0.0), 0.0, 5.0), (0.0, 5.0))
    assert table.pairs["rubs"][0] == 1
    for load in (5.0, 3.0, 7.0):
        rows = table.row((0.0, 1e-4), 0.3, load)  # creeps below the floor
        rows["touched"] = 0
        drives = table.step(rows, (load, load))
        assert not len(drives["force"])
        assert not rows["touched"].any()
    assert not table.pairs["gains"][0]


def test_a_pair_that_slides_drives_both_bodies_and_ends_with_its_load() -> None:
    table = Table()
    table.step(table.row((0.0, 0.4), 0.3, 5.0), (0.0, 5.0))
    drives = table.step(table.row((0.0, 0.4), 0.3, 5.0), (5.0, 5.0))
    assert drives["body"].tolist() == [[0, 1]] and drives["slot"].tolist() == [0]
    assert drives["force"].std() > 0
    assert (drives["force"] >= -5.0 * (1 + 1e-12)).all()  # surfaces do not pull
    assert drives["direction1"][0] == pytest.approx([0.3, 0.0, -1.0])
    shape = table.shapes.reshape(2, 3, 3, COLUMNS)[:, 0]  # of vertex 0: (body, axis, column)
    for side, sign in ((0, 1), (1, -1)):
        assert drives["gain1"][0, side] == pytest.approx(sign * (0.3 * shape[side, 0] - shape[side, 2]))
    last = table.step(np.zeros(0, ROW), (5.0, 0.0))
    assert len(last["force"]) == 1  # fades, with the gains that it had
    assert (last["gain0"] == drives["gain1"]).all() and (last["gain1"] == drives["gain1"]).all()
    assert table.pairs["rubs"][0] == 0
    assert not len(table.step(np.zeros(0, ROW), (0.0, 0.0))["force"])


def test_gains_and_directions_begin_where_the_step_before_ended_and_follow() -> None:
    table = Table()
    table.step(table.row((0.0, 0.4), 0.3, 5.0), (0.0, 5.0))
    before = table.step(table.row((0.0, 0.4), 0.3, 5.0), (5.0, 5.0))
    after = table.step(table.row((0.0, 0.4), -0.2, 5.0, corner=2), (5.0, 5.0))
    assert (after["gain0"] == before["gain1"]).all()
    assert (after["direction0"] == before["direction1"]).all()
    left = np.exp(-DT_S / FOLLOW_S)
    assert after["direction1"][0, 0] == pytest.approx(-0.2 + left * 0.5)
    shape = table.shapes.reshape(2, 3, 3, COLUMNS)[0, 2]
    aim = -0.2 * shape[0] - shape[2]
    assert after["gain1"][0, 0] == pytest.approx(aim + left * (before["gain1"][0, 0] - aim))


def test_a_manifold_that_pulls_sideways_without_load_does_not_steer() -> None:
    table = Table()
    table.step(table.row((0.0, 0.4), 0.3, 5.0), (0.0, 5.0))
    before = table.step(table.row((0.0, 0.4), 0.3, 5.0), (5.0, 5.0))
    after = table.step(table.row((0.0, 0.4), 100.0, 5.0), (5.0, 5.0))
    assert (after["direction1"] == before["direction1"]).all()
    assert table.pairs["sweep_m_s"][0].tolist() == [0.0, 0.0]


def test_nothing_rubs_where_neither_body_sounds_or_moves() -> None:
    for name, value in (("modes", 0), ("mass_kg", 0.0)):
        table = Table()
        table.bodies[name] = value
        assert not len(table.step(table.row((0.0, 0.4), 0.3, 5.0), (0.0, 5.0))["force"])
        assert table.pairs["rubs"][0] == 0
