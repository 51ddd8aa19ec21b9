"""What a mode loses to the air is played once: on top of a material's own damping, not on top of one that was recorded
with it.
"""

from __future__ import annotations

from dataclasses import replace
from pathlib import Path

import msgspec
import numpy as np
import pytest

from sonic_bullet.effects.presets_of_effects import with_modes
from sonic_bullet.engine.bank.resonator import build_resonator
from sonic_bullet.engine.runtime.replay import render_log
from sonic_bullet.files import presets, read_log, read_model, write_log, write_model
from sonic_bullet.files.contact_log import ContactLog
from sonic_bullet.files.presets import Provenance, load_material, material_of, named_preset, total_damping, write_preset
from sonic_bullet.modal import analyse
from sonic_bullet.radiation.radiated import radiation_of
from sonic_bullet.records import Air, Body, Material, Microphone, Shape
from tests.made.models import STEEL, ball_body, box_body, row, step

FREQ_HZ = (740.0, 1230.0, 2950.0)
TOTAL = replace(STEEL, name="total", includes_radiation=True)


def body(material: Material, body_id: int = 0) -> Body:
    made = box_body((0.2, 0.1, 0.01), FREQ_HZ, material, body_id=body_id)
    assert made.model is not None
    return replace(made, model=replace(made.model, includes_radiation=material.includes_radiation))


def test_total_damping_is_played_as_it_is() -> None:
    own, total = body(STEEL), body(TOTAL)
    assert own.model is not None and total.model is not None
    weight, extra = radiation_of(own.model, Air())
    assert (extra > 0.01 * own.model.decay_per_s).all()
    one, two = (build_resonator(x, (), 48_000, Air()) for x in (own, total))
    assert one.decay_per_s == pytest.approx(own.model.decay_per_s + extra, rel=1e-12)
    assert two.decay_per_s == pytest.approx(total.model.decay_per_s, rel=1e-12)
    for resonator in (one, two):  # as loud, in air as ever
        assert np.abs(resonator.weight[0]) == pytest.approx(np.abs(weight), rel=1e-12)
    assert two.omega_rad_s == pytest.approx(2 * np.pi * np.array(FREQ_HZ), rel=1e-12)


def test_it_travels_from_the_preset_to_the_modes(tmp_path: Path) -> None:
    steel = named_preset("steel")
    write_preset(
        tmp_path / "total.json",
        msgspec.structs.replace(steel, damping=msgspec.structs.replace(steel.damping, includes_radiation=True)),
    )
    shape = (Shape("box", np.array([0.1, 0.02, 0.004])),)
    models = [
        analyse(shape, load_material(name), count=3, cache=None) for name in ("steel", str(tmp_path / "total.json"))
    ]
    assert [m.includes_radiation for m in models] == [False, True]
    law = presets.effect_of({"id": "damping-law", "law": "constant-loss", "eta": 1e-3})
    assert with_modes(models[1], replace(load_material(tmp_path / "total.json"), effects=(law,))).includes_radiation
    write_model(tmp_path / "m.npz", models[1])
    assert read_model(tmp_path / "m.npz").includes_radiation


def log_of(material: Material) -> ContactLog:
    hit = row(0, 1, (0, 0, -0.01), normal=(0, 0, -1), point_a=(0.03, 0.01, 0.005), point_b=(0, 0, -0.01))
    steps = tuple(step([(0, 0, 0), (0, 0, 0.015)], hit if i == 2 else None) for i in range(12))
    return ContactLog((body(material), ball_body(0.01, body_id=1)), steps, (Microphone([0, 0.3, 0.4]),), 48_000, 0)


def test_a_log_keeps_it_and_older_logs_are_as_they_were(tmp_path: Path) -> None:
    sounds = []
    for material in (STEEL, TOTAL):
        log = log_of(material)
        write_log(tmp_path / "log.npz", log)
        again = read_log(tmp_path / "log.npz")
        assert again.bodies[0].model is not None and again.bodies[0].material is not None
        assert (
            again.bodies[0].model.includes_radiation
            == again.bodies[0].material.includes_radiation
            == material.includes_radiation
        )
        sounds.append(render_log(log))
        assert render_log(again).tobytes() == sounds[-1].tobytes()
        # a log without it is the older one's bytes
        assert (b"includes_radiation" in (tmp_path / "log.npz").read_bytes()) == material.includes_radiation
    late = slice(-480, None)
    assert np.abs(sounds[1][0, late]).max() > np.abs(sounds[0][0, late]).max()


@pytest.mark.parametrize(
    ("says", "fitted", "assumed", "total"),
    [
        (None, False, (), False),  # a table: the material's own
        (None, True, (), True),  # of `fit` before it said so: it read total decays
        (None, True, ("damping (from 'steel')",), False),  # of the same where the recordings told none
        (False, True, (), False),
        (True, False, (), True),
    ],
)
def test_what_a_preset_means(says: bool | None, fitted: bool, assumed: tuple[str, ...], total: bool) -> None:
    steel = named_preset("steel")
    origin = (
        Provenance(method="modes paired with damped sinusoids of maximum likelihood; least squares", assumed=assumed)
        if fitted
        else None
    )
    preset = msgspec.structs.replace(
        steel, damping=msgspec.structs.replace(steel.damping, includes_radiation=says), provenance=origin
    )
    assert total_damping(preset) is material_of(preset).includes_radiation is total


def test_no_table_of_the_package_includes_radiation() -> None:
    assert not any(material.includes_radiation for material in map(presets.load_material, presets.table_names()))
