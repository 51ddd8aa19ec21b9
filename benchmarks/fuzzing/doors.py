"""Every format that the project reads: a seed file, how it is changed, the reader it goes through, and one step beyond
that reader.

log -> rendered for two steps     model -> struck once     preset -> material -> struck once     case -> loaded
audio -> features     mesh -> surface, volume, closed or not     baked model -> struck     UFF -> recordings
"""

from __future__ import annotations

import json
import random
import tempfile
from collections.abc import Callable
from dataclasses import dataclass, replace
from functools import cache
from pathlib import Path
from typing import Any

import numpy as np

from benchmarks.fuzzing import containers, meshes, sounds, uff
from benchmarks.fuzzing.mutations import json_changed
from sonic_bullet import files
from sonic_bullet.effects.presets_of_effects import with_material, with_modes
from sonic_bullet.engine.runtime.replay import render_log
from sonic_bullet.files import presets
from sonic_bullet.files.cases import read_case
from sonic_bullet.files.contact_log import ContactLog
from sonic_bullet.geometry import is_closed, volume_m3
from sonic_bullet.records import Body, Material, Microphone, ModalModel, ModalSum, Residual, Vibrometer
from sonic_bullet.records.contacts import Contacts, Event, Step
from sonic_bullet.records.mode_shapes import quantize_shapes

SR = 8000
STEEL = Material.isotropic(
    "steel", youngs_pa=2e11, poisson=0.29, density_kg_m3=7850, alpha_per_s=4.0, beta_s=2e-9, restitution=0.6
)
FEATURES_SAMPLES = 560


@dataclass(frozen=True)
class Door:
    """name: of the format.

    suffix: of its files. share: of all inputs. seed: the file unchanged; change: mutated. enter: reads it and goes one
    step on.
    """

    name: str
    suffix: str
    share: float
    seed: Callable[[], bytes]
    change: Callable[[random.Random], bytes]
    enter: Callable[[Path], object]


def box_model(modes: int = 3) -> ModalModel:
    """A small box whose corners move at random."""
    corner = np.array([[x, y, z] for x in (-1, 1) for y in (-1, 1) for z in (-1, 1)]) * np.array([0.05, 0.04, 0.025])
    quads = [(0, 1, 3, 2), (4, 6, 7, 5), (0, 4, 5, 1), (2, 3, 7, 6), (0, 2, 6, 4), (1, 5, 7, 3)]
    face = np.array([t for q in quads for t in ((q[0], q[1], q[2]), (q[0], q[2], q[3]))])
    freq = np.array([900.0, 2100.0, 3900.0])[:modes]
    shape = quantize_shapes(np.random.default_rng(0).normal(size=(8, 3, modes)))
    return ModalModel(
        freq,
        5 + 1e-6 * freq**2,
        shape,
        corner,
        face,
        np.zeros(12),
        4e-4,
        3.14,
        bend_s2_m2=np.full(modes, 1e-3),
        damping_growth_s_m=np.zeros(modes),
    )


def small_log(model: ModalModel, material: Material = STEEL, *, microphone: bool = True) -> ContactLog:
    """A box struck once by a wall, three steps long."""
    inertia = np.diag([0.002, 0.003, 0.004])
    bodies = (
        Body(0, -1, 0, "box", 3.14, inertia, 4e-4, material=material, model=model),
        Body(3, -1, 0, "wall", 0.0, np.zeros((3, 3))),
    )
    one: dict[str, Any] = {
        "a": [0],
        "b": [1],
        "point_a_m": [[0.05, 0.04, -0.025]],
        "point_b_m": [[0, 0, 0]],
        "normal": [[0, 0, 1]],
    }
    one |= {
        "impulse_n_s": [[0, 0, 0.01]],
        "slip_m_s": [[0.1, 0, 0]],
        "sweep_m_s": [[0.1, 0]],
        "approach_m_s": [1.0],
        "gap_m": [0.0],
    }
    place, upright = [[0, 0, 0.1], [0, 0, 0]], [[0, 0, 0, 1.0]] * 2
    steps = [
        Step(1 / 240, place, upright, [False, False], contacts, [0, 0, -9.81])  # type: ignore[arg-type]
        for contacts in (Contacts(**one), Contacts.none(), Contacts(**one))
    ]
    vibrometer = Vibrometer(0, [0, 0, 0.025], [0, 0, 1])
    sensors = (Microphone([0, -1, 0.5]), vibrometer, ModalSum(1.0))
    return ContactLog(
        bodies,
        tuple(steps),
        sensors if microphone else sensors[2:],
        SR,
        0,
        events=(Event("quench", 1), Event("quench", 2)),
    )


def struck(model: ModalModel, material: Material = STEEL) -> None:
    """The sound of the model's body in `small_log`, by the sum of its modes."""
    render_log(small_log(model, material, microphone=False))


def residual() -> Residual:
    line = np.array([500.0, 1500.0])
    return Residual(
        line,
        line / 100,
        line / 1e6,
        line,
        line / 50,
        line / 1e6,
        np.array([100.0, 1e3]),
        np.array([0.0, 0.1]),
        np.ones((2, 2)) * 1e-9,
        0.1,
        "x",
    )


def preset_seed() -> dict[str, Any]:
    """A preset with every group, every kind of effect and a residual."""
    from sonic_bullet.files.residual_code import form_of

    seed: dict[str, Any] = json.loads((presets.TABLES_FOLDER / "steel.json").read_text())
    import msgspec

    seed["effects"] = [
        {"id": "damping-law", "law": "constant-loss", "eta": 1e-3},
        {"id": "mode-splitting", "freq_hz": [900.0], "split": [0.01], "turn_rad": [0.1]},
        {"id": "amplitude-pitch", "bend": 0.01, "measure": "velocity"},
        {"id": "amplitude-damping", "choke": 0.1, "measure": "velocity", "power": 1.0},
    ]
    seed["residual"] = msgspec.to_builtins(form_of(residual()))
    seed["provenance"] = {
        "method": "x",
        "recordings": ["a.wav"],
        "parameters": {"alpha_per_s": 1.0},
        "spreads": {"alpha_per_s": None},
        "correction": {"a": [0.1]},
    }
    return seed


def case_seed() -> dict[str, Any]:
    """A case that declares all there is to declare."""
    strike = {
        "position": [0, 0, 0.1],
        "direction": [0, 0, -2],
        "impulse": 0.01,
        "force": {"file": "f.wav", "channel": 0, "newton_per_unit": 2.0},
    }
    guess = {"youngs_modulus": 2e11, "density": 7850, "poisson_ratio": 0.3}
    return {
        "format": "sonic-bullet-case/1",
        "case": "bar",
        "objects": {"bar": {"mesh": "bar.obj", "units": "mm", "material": "steel", "elastic_guess": guess}},
        "support": {"fixed": [{"position": [1, 2, 3], "radius": 0.5, "object": "bar"}]},
        "sensor": {
            "type": "microphone",
            "response": "sound pressure",
            "position": {"bar": [0, 0, 0]},
            "direction": [0, 0, 1],
        },
        "band_hz": [20, 20000],
        "onset": 0.0,
        "recordings": [
            {"file": "a.wav", "object": "bar", "split": "fit", "strike": strike, "channel": 0},
            {
                "object": "bar",
                "split": "holdout",
                "features": [{"freq_hz": 100.0, "decay_per_s": 1.0, "freq_sd_hz": 0.1, "amplitude": 1.0}],
            },
        ],
    }


def _enter_log(path: Path) -> None:
    log = files.read_log(path)
    render_log(log.first(2))


def _enter_model(path: Path) -> None:
    struck(files.read_model(path))


def _enter_preset(path: Path) -> None:
    material = with_material(presets.load_material(path))
    struck(with_modes(box_model(), material), material)


def _enter_case(path: Path) -> None:
    for thing in read_case(path).objects.values():
        if thing.mesh is not None:
            thing.mesh.exists()


def _enter_audio(path: Path) -> None:
    from sonic_bullet.lab.lines.extraction import extract

    sound, sr = files.read_audio(path)
    if sum(path.stem.encode()) & 3 == 0:  # a fit takes a hundred times as long as a read: a quarter of them
        extract(sound[0, :FEATURES_SAMPLES], sr)


def _enter_mesh(path: Path) -> None:
    from sonic_bullet.modal import read_mesh
    from sonic_bullet.simulators.pybullet.urdf_meshes import join_surfaces, read_surfaces

    try:
        shape = read_mesh(path, 0.5)
        volume_m3(shape.vertex_m, shape.face)
    finally:
        is_closed(join_surfaces(read_surfaces(path))[1])


def _enter_baked(path: Path) -> None:
    from sonic_bullet.apps.bake import choose_strike, read_baked, render_strike

    for model in read_baked(path):
        render_strike(model, choose_strike(model), SR, 0.05)


def _enter_uff(path: Path) -> None:
    from sonic_bullet.files.uff.impulse_response import as_period, since_impulse
    from sonic_bullet.files.uff.reader import read_uff

    for response in read_uff(path).responses:
        sound, sr, measured_hz = as_period(response)
        if response.spectral:
            since_impulse(sound, sr, measured_hz)


def baked_seed() -> dict[str, Any]:
    """A baked model with all its fields."""
    from sonic_bullet.apps.bake import bake_body, write_baked

    with tempfile.TemporaryDirectory() as folder:
        write_baked(f"{folder}/a.json", [bake_body(small_log(box_model()).bodies[0])])
        found: dict[str, Any] = json.loads(Path(folder, "a.json").read_text())
        return found


def _entries(write: Callable[[str], None]) -> containers.Entries:
    with tempfile.TemporaryDirectory() as folder:
        write(f"{folder}/a.npz")
        return containers.taken_apart(f"{folder}/a.npz")


@cache
def doors() -> tuple[Door, ...]:
    """All of them; shares add up to 1."""
    log, model = (
        _entries(lambda path: files.write_log(path, small_log(box_model(), replace(STEEL, residual=residual())))),
        _entries(lambda path: files.write_model(path, box_model())),
    )
    preset, case = preset_seed(), case_seed()

    def packed(name: str, share: float, entries: containers.Entries, enter: Callable[[Path], object]) -> Door:
        return Door(
            name,
            ".npz",
            share,
            lambda: containers.put_together(entries),
            lambda draw: containers.container_changed(entries, draw),
            enter,
        )

    def written(name: str, share: float, seed: dict[str, Any], enter: Callable[[Path], object]) -> Door:
        return Door(
            name, ".json", share, lambda: json.dumps(seed).encode(), lambda draw: json_changed(seed, draw), enter
        )

    def sound(suffix: str, share: float) -> Door:
        data = sounds.seed(suffix)
        change = {".flac": sounds.flac_changed, ".ogg": sounds.ogg_changed}.get(suffix, sounds.plain_changed)
        return Door(suffix[1:], suffix, share, lambda: data, lambda draw: change(data, draw), _enter_audio)

    def mesh(kind: str, share: float) -> Door:
        data = meshes.seed(kind)
        return Door(
            f"mesh {kind}",
            "." + kind.split("_", maxsplit=1)[0],
            share,
            lambda: data,
            lambda draw: meshes.mesh_changed(kind, data, draw),
            _enter_mesh,
        )

    return (
        packed("log", 0.16, log, _enter_log),
        packed("model", 0.08, model, _enter_model),
        written("preset", 0.10, preset, _enter_preset),
        written("case", 0.12, case, _enter_case),
        written("baked", 0.05, baked_seed(), _enter_baked),
        Door("uff", ".uff", 0.05, uff.seed, lambda draw: uff.uff_changed(uff.seed(), draw), _enter_uff),
        *(sound(suffix, 0.03) for suffix in (".wav", ".rf64", ".w64", ".flac", ".ogg", ".aiff", ".caf")),
        *(mesh(kind, 0.23 / len(meshes.KINDS)) for kind in meshes.KINDS),
    )
