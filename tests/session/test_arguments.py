"""Every argument of everything public: what is no value of it is one line of our own that names it, whatever it is."""

from __future__ import annotations

import inspect
import math
from collections.abc import Callable
from pathlib import Path
from typing import Any

import numpy as np
import pybullet
import pytest

import sonic_bullet as sb
from sonic_bullet import scene
from sonic_bullet.apps.bake.json_models import write_json_models
from sonic_bullet.records.errors import (
    AudioError,
    MaterialError,
    MeshError,
    ModalError,
    RecordError,
    SceneError,
    SonicBulletError,
)
from sonic_bullet.records.touching.link_motions import LINK_MOTION
from sonic_bullet.records.touching.surface_form import SurfaceForm
from tests.made import heads
from tests.made.models import STEEL
from tests.made.worlds import box, plate_model

LONGEST = 300
Made = tuple[Callable[..., Any], dict[str, Any]]
SHAPE = {
    "kind": "box",
    "size_m": [0.1, 0.1, 0.1],
    "position_m": [0, 0, 0],
    "quaternion_xyzw": [0, 0, 0, 1],
    "vertex_m": np.zeros((0, 3)),
    "face": np.zeros((0, 3), np.int32),
}
TETRAHEDRON = {
    "vertex_m": [[0, 0, 0], [1, 0, 0], [0, 1, 0], [0, 0, 1]],
    "face": [[0, 2, 1], [0, 1, 3], [0, 3, 2], [1, 2, 3]],
}
ROW = {
    "a": [0],
    "b": [1],
    "point_a_m": [[0, 0, 0]],
    "point_b_m": [[0, 0, 0]],
    "normal": [[0, 0, 1]],
    "impulse_n_s": [[0, 0, 1]],
    "slip_m_s": [[0, 0, 0]],
    "sweep_m_s": [[0, 0]],
    "approach_m_s": [1],
    "gap_m": [0],
}
STEP = {
    "dt_s": 1 / 240,
    "position_m": np.zeros((2, 3)),
    "quaternion_xyzw": [[0, 0, 0, 1]] * 2,
    "teleported": [False, False],
    "contacts": sb.Contacts.none(),
    "gravity_m_s2": [0, 0, -9.8],
    "body": [0, 1],
    "motions": np.zeros(1, LINK_MOTION),
}
MATERIAL = {
    "name": "m",
    "density_kg_m3": 1000,
    "stiffness_pa": STEEL.stiffness_pa,
    "alpha_per_s": 1,
    "beta_s": 0,
    "roughness_m": 0,
    "hurst": 0.5,
    "restitution": 0,
    "source": "",
    "residual": None,
    "effects": (),
    "includes_radiation": False,
    "octave_rms_m": np.full(14, 1e-7),
    "form": SurfaceForm(),
}
MODEL = dict(
    freq_hz=[100.0],
    decay_per_s=[1.0],
    shape=np.zeros((4, 3, 1)),
    **TETRAHEDRON,
    curvature_per_m=np.zeros(4),
    volume_m3=1,
    mass_kg=1,
    dropped=0,
    note="",
    bend_s2_m2=None,
    damping_growth_s_m=None,
    damping_growth_power=1,
    includes_radiation=False,
    stands_for=None,
    assumed_wall_m=0,
    solution="full",
    touched=None,
)
LOG = {
    "bodies": (),
    "steps": (),
    "sensors": (),
    "sr": 48_000,
    "seed": 0,
    "air": sb.Air(),
    "untouched": frozenset(),
    "events": (),
    "engine": {},
    "versions": {},
    "changes": (),
    "residual": True,
    "supports": True,
    "image": True,
}


PLACED = {
    "position_m": [0, 0, 0],
    "quaternion_xyzw": [0, 0, 0, 1],
    "body_id": None,
    "link": -1,
    "path": None,
    "directivity": False,
}
ALONG = {"time_s": [0.0, 1.0], "position_m": [[0, 0, 0], [1, 0, 0]], "quaternion_xyzw": None}
HEAD = {"direction": [[1.0, 0, 0], [0, 1, 0]], "response": np.ones((2, 2, 4)), "sr": 48_000, "name": "head"}


def written_head(folder: Path) -> Path:
    """A head's file."""
    heads.write_sofa(folder / "head.sofa", sb.Head(**HEAD))
    return folder / "head.sofa"


def one_step() -> sb.ContactLog:
    """A log of one step in which nothing is."""
    nobody = sb.Step(1 / 240, np.zeros((0, 3)), np.zeros((0, 4)), np.zeros(0, bool), sb.Contacts.none())
    return sb.ContactLog(**{**LOG, "steps": (nobody,)})


BUILT = (
    "import pybullet as p\nSECONDS = 0.01\n\ndef build(client):\n"
    "    client.createMultiBody(0, client.createCollisionShape(p.GEOM_PLANE))\n    return {}\n"
)


def listener_of(client: Any) -> tuple[sb.Listener, int]:
    body = box(client, (0, 0, 1))
    return sb.attach(client), body


def adding(client: Any, _: Path) -> Made:
    listener, body = listener_of(client)
    rest = {
        "mesh": None,
        "roughness_m": 0,
        "name": None,
        "fixed": (),
        "thickness_m": None,
        "to_hz": 20_000,
        "count": None,
        "accuracy": 0.01,
        "tail": True,
        "mounting": None,
        "progress": None,
    }
    return listener.add, {"body": body, "link": -1, "material": STEEL, "model": plate_model(), **rest}


def adding_all(client: Any, _: Path) -> Made:
    listener, body = listener_of(client)
    return listener.add_all, {
        "cast": {body: {"material": STEEL, "model": plate_model()}},
        "progress": None,
        "optional": False,
    }


def writing(client: Any, folder: Path) -> Made:
    listener, _ = listener_of(client)
    client.stepSimulation()
    return listener.write, {
        "path": folder / "a.wav",
        "peak_dbfs": None,
        "lufs": None,
        "full_scale_pa": 1,
        "subtype": None,
        "tail_db": None,
    }


def scene_file(_: Any, folder: Path) -> Made:
    (folder / "scene.py").write_text(BUILT)
    rest = {
        "seconds": None,
        "sr": 8000,
        "seed": 0,
        "microphones": None,
        "material": None,
        "materials": None,
        "silent": (),
        "fill_modes": True,
        "draft": True,
        "residual": True,
        "supports": True,
        "image": True,
        "at_start": None,
        "at_end": None,
        "tail_db": None,
        "client": None,
    }
    return scene.render_scene, {"path": folder / "scene.py", **rest}


BALL = {"name": "ball", "mesh": sb.Shape("sphere", size_m=(0.02, 0, 0)), "material": None}
CONTACT = {"pair": [[0, 1]], "point_m": [[0, 0, 0]], "normal": [[0, 0, 1]], "impulse_n_s": [[0, 0, 1]], "gap_m": [0]}
TWISTS = {"velocity_m_s": np.zeros((2, 3)), "spin_rad_s": np.zeros((2, 3))}


def log_adding(*_: Any) -> Made:
    solid = {"mass_kg": 0.1, "inertia_kg_m2": [1e-5] * 3, "centre_m": [0, 0, 0]}
    return sb.LogWriter().add, {**BALL, **solid}


def log_step(*_: Any) -> Made:
    writer = sb.LogWriter()
    for name in ("ball", "other"):
        writer.add(**{**BALL, "name": name}, mass_kg=0.1)
    poses = {name: STEP[name] for name in ("dt_s", "position_m", "quaternion_xyzw", "gravity_m_s2")}
    return writer.step, {**poses, **CONTACT, **TWISTS, "moved": ()}


def log_save(_: Any, folder: Path) -> Made:
    writer = sb.LogWriter()
    writer.step(0.01, np.zeros((0, 3)), np.zeros((0, 4)))
    return writer.save, {"path": folder / "a.npz", "models": "included"}


def reading_audio(_: Any, folder: Path) -> Made:
    sb.write_audio(folder / "a.wav", np.zeros((1, 10)), 8000)
    return sb.read_audio, {"path": folder / "a.wav"}


def reading_room_response(_: Any, folder: Path) -> Made:
    sb.write_audio(folder / "a.wav", np.ones((1, 10)), 8000)
    return sb.read_room_response, {"path": folder / "a.wav"}


def reading_response(_: Any, folder: Path) -> Made:
    (folder / "a.csv").write_text("100,0.5\n1000,1\n")
    return sb.read_response, {"path": folder / "a.csv"}


def reading_log(_: Any, folder: Path) -> Made:
    sb.ContactLog(**LOG).save(folder / "a.npz")
    return sb.read_log, {"path": folder / "a.npz"}


def reading_baked(_: Any, folder: Path) -> Made:
    write_json_models(folder / "a.json", ())
    return sb.read_baked, {"path": folder / "a.json"}


def of_log(name: str) -> Callable[[Any, Path], Made]:
    def make(client: Any, _: Path) -> Made:
        listener, body = listener_of(client)
        listener.add(body, material=STEEL, model=plate_model())
        return getattr(listener.contacts, name), {"body": body, "link": None}

    return make


KEEPS = {"supports": True, "image": True, "draft": False, "keep_log": True, "keep_sound": True}
DOORS: dict[str, Callable[[Any, Path], Made]] = {
    "Air": lambda *_: (sb.Air, {"density_kg_m3": 1, "sound_speed_m_s": 343}),
    "ContactLog": lambda *_: (sb.ContactLog, LOG),
    "ContactLog.impulse_on": of_log("impulse_on"),
    "ContactLog.rows_on": of_log("rows_on"),
    "ContactLog.settings": lambda *_: (sb.ContactLog(**LOG).settings, {"step": 0}),
    "ContactLog.save": lambda _, folder: (
        sb.ContactLog(**LOG).save,
        {"path": folder / "a.npz", "models": "included"},
    ),
    "Contacts": lambda *_: (sb.Contacts, ROW),
    "Listener": lambda client, _: (
        sb.Listener,
        {"client": client, "sr": 48_000, "sensors": (), "seed": 0, "air": sb.Air(), **KEEPS},
    ),
    "Listener.add": adding,
    "Listener.add_all": adding_all,
    "Listener.write": writing,
    "LogWriter": lambda *_: (
        sb.LogWriter,
        {"sr": 48_000, "microphone": (0, 0, 1), "seed": 0, "air": None, "supports": True, "image": True},
    ),
    "LogWriter.add": log_adding,
    "LogWriter.step": log_step,
    "LogWriter.save": log_save,
    "Material": lambda *_: (sb.Material, MATERIAL),
    "Material.isotropic": lambda *_: (
        sb.Material.isotropic,
        {"name": "m", "youngs_pa": 1e9, "poisson": 0.3, "density_kg_m3": 1000},
    ),
    "Ambisonics": lambda *_: (sb.Ambisonics, {**PLACED, "order": 1}),
    "Binaural": lambda *_: (sb.Binaural, {**PLACED, "head": sb.Head(**HEAD)}),
    "Head": lambda *_: (sb.Head, HEAD),
    "Microphone": lambda *_: (sb.Microphone, PLACED),
    "MicrophonePath": lambda *_: (sb.MicrophonePath, ALONG),
    "ModalModel": lambda *_: (sb.ModalModel, MODEL),
    "ModalSum": lambda *_: (sb.ModalSum, {"scale": 1}),
    "ShoeboxRoom": lambda *_: (sb.ShoeboxRoom, {"size_m": [6, 4, 3], "absorption": 0.2, "corner_m": None}),
    "RoomResponse": lambda *_: (sb.RoomResponse, {"response": np.ones((1, 4)), "sr": 48_000, "name": "hall"}),
    "Shape": lambda *_: (sb.Shape, SHAPE),
    "Step": lambda *_: (sb.Step, STEP),
    "Vibrometer": lambda *_: (sb.Vibrometer, {"body_id": 0, "point_m": [0, 0, 0], "direction": [0, 0, 1], "link": -1}),
    "ContactMicrophone": lambda *_: (
        sb.ContactMicrophone,
        {
            "body_id": 0,
            "point_m": [0, 0, 0],
            "direction": [0, 0, 1],
            "link": -1,
            "response": None,
            "noise_m_s2_rthz": 0.0,
        },
    ),
    "SensorResponse": lambda *_: (sb.SensorResponse, {"freq_hz": [100, 1000], "magnitude": [0.5, 1]}),
    "read_response": reading_response,
    "attach": lambda client, _: (
        sb.attach,
        {"client": client, "sr": 48_000, "microphone": (0, 0, 1), "seed": 0, "air": None, **KEEPS},
    ),
    "compare": lambda *_: (sb.compare, {"a": one_step(), "b": one_step(), "say": None}),
    "keep_restitution": lambda client, _: (sb.keep_restitution, {"client": client}),
    "load_material": lambda *_: (sb.load_material, {"name": "steel"}),
    "read_audio": reading_audio,
    "read_baked": reading_baked,
    "read_head": lambda _, folder: (sb.read_head, {"path": written_head(folder)}),
    "read_log": reading_log,
    "read_room_response": reading_room_response,
    "render_log": lambda *_: (
        sb.render_log,
        {"log": sb.ContactLog(**LOG), "sr": None, "residual": True, "room": None, "progress": None, "say": None},
    ),
    "render_scene": scene_file,
    "write_audio": lambda _, folder: (
        sb.write_audio,
        {
            "path": folder / "a.wav",
            "samples": np.ones((1, 8000)),
            "sr": 8000,
            "peak_dbfs": None,
            "lufs": None,
            "full_scale_pa": 1,
            "subtype": None,
            "cues": None,
            "time_reference": 0,
        },
    ),
}
WITHOUT_ARGUMENTS = {"list_materials", "SonicBulletError"}

WORDS = ["x", object(), {}, 1j, Exception]
"""No number, no point, no array, no path, no record."""
NUMBER = [*WORDS, None, math.nan, math.inf, 10**400, [1, 2], True]
OPTIONAL = [value for value in NUMBER if value is not None]
ARRAY = ["x", object(), {}, 1j, None, [[1], [2, 3]], ["a", "b", "c"], math.nan, [math.nan] * 3]
PATH = [None, 5, object(), b"a.wav", ["a.wav"], 1.5]
CALL = ["x", 5, [print]]
FLAG = ["no", None, 0, 1.0]
TEXT = [None, 5, b"m", ["m"]]
RECORD = ["helium", 5, object(), {}]
WHOLE = [*NUMBER, 1.5]
ON_SURFACE = {
    "body_id": WHOLE,
    "point_m": [*ARRAY, [0, 0]],
    "direction": [*ARRAY, [0, 0], [0, 0, 0]],
    "link": WHOLE,
}
CLIENT = [None, "client", 99, -1, 10**30, True, object(), pybullet.connect]
PLACED_BAD: dict[str, list[Any]] = {
    "position_m": [*ARRAY, [0, 0]],
    "quaternion_xyzw": [*ARRAY, [0, 0, 0, 0]],
    "body_id": [*OPTIONAL, 1.5],
    "link": WHOLE,
    "path": RECORD,
    "directivity": FLAG,
}
BAD: dict[str, dict[str, list[Any]]] = {
    "Air": {"density_kg_m3": [*NUMBER, 0, -1], "sound_speed_m_s": [*NUMBER, 0]},
    "ContactLog": {
        "bodies": ["x", 5, [3], None],
        "steps": ["x", 5, [3], None],
        "sensors": ["x", 5, [3], None],
        "sr": [*NUMBER, 0],
        "seed": [*NUMBER, -1],
        "air": [*RECORD, None],
        "untouched": ["x", 5, None],
        "events": ["x", 5, None, object(), [3]],
        "engine": ["x", 5, None, object(), [3], {1: 2}, {"erp": "x"}, {"erp": None}, {"erp": math.nan}],
        "versions": ["x", 5, None, object(), [3], {1: "2"}, {"numpy": 2.0}, {"numpy": None}],
        "changes": ["x", 5, None, object(), [3]],
        "residual": FLAG,
        "supports": FLAG,
        "image": FLAG,
    },
    "ContactLog.impulse_on": {"body": WHOLE, "link": [*OPTIONAL, 1.5]},
    "ContactLog.rows_on": {"body": WHOLE, "link": [*OPTIONAL, 1.5]},
    "ContactLog.settings": {"step": [*WHOLE, -1]},
    "ContactLog.save": {"path": PATH, "models": ["x", None, 5, object(), b"reference"]},
    "Contacts": {name: [*ARRAY, 5, [0, 1, 2, 3]] for name in ROW}
    | {"a": ["x", object(), {}, 1j, None, 5, [0.5], [2**40], [math.nan]]},
    "Listener": {
        "client": CLIENT,
        "sr": [*NUMBER, 0],
        "sensors": ["x", 5, [3], None, object()],
        "seed": [*WHOLE, -1],
        "air": [*RECORD, None],
        **dict.fromkeys(KEEPS, FLAG),
    },
    "Listener.add": {
        "body": [*WHOLE, -5, 10**12],
        "link": [*[value for value in WHOLE if value != "x"], -2, 7, "arm", b"arm", (0, 1)],
        "material": [None, 5, b"steel", object(), ["steel"], {}],
        "mesh": [5, object(), {}, True, [5], ["a.obj"], b"a.obj", pybullet],
        "model": [*RECORD],
        "roughness_m": [*OPTIONAL, -1],
        "name": [5, b"cup", ["cup"], "", " ", "a\nb", object(), 1.5, True],
        "fixed": [
            "x",
            5,
            None,
            [(0, 0, 0)],
            (0, 0, 0, 0.1),
            [(0, 0, 0, "r")],
            [(0, 0, 0, math.nan)],
            [(0, 0, 0, -1)],
            {},
            [5],
            object(),
        ],
        "thickness_m": [*OPTIONAL, 0, -1, 1e308],
        "to_hz": [*NUMBER, 0, -1, 1e308],
        "count": [*OPTIONAL, 0, -1, 2.5, 10**9],
        "accuracy": [*OPTIONAL, 0, -1, 0.6],
        "tail": FLAG,
        "mounting": ["glued", b"free", object(), ["free"], -1, 1.5, math.nan, True],
        "progress": CALL,
    },
    "Listener.add_all": {
        "cast": [None, 5, "steel", b"steel", object(), ["steel"], [(0, "steel")]],
        "progress": CALL,
        "optional": FLAG,
    },
    "Listener.write": {
        "path": PATH,
        "peak_dbfs": [*OPTIONAL, 3, 0.1, -1e9],
        "lufs": [*OPTIONAL, 1e9],
        "full_scale_pa": [*OPTIONAL, 0, -1],
        "subtype": [5, b"PCM_16", object()],
        "tail_db": [*OPTIONAL, 3, -1e9],
    },
    "LogWriter": {
        "sr": [*NUMBER, 0],
        "microphone": ["here", 5, None, object(), {}, [(0, 0)], (0, 0, math.nan)],
        "seed": [*WHOLE, -1],
        "air": RECORD,
        "supports": FLAG,
        "image": FLAG,
    },
    "LogWriter.add": {
        "name": [5, None, b"cup", ["cup"], "", "a\nb"],
        "mesh": [5, None, object(), {}, [5], b"a.obj"],
        "material": [5, b"steel", object(), ["steel"], {}],
        "mass_kg": [*OPTIONAL, -1, 1e300],
        "inertia_kg_m2": [value for value in ARRAY if value is not None] + [[-1, 1, 1], [[1, 2], [3, 4]], 5],
        "centre_m": [value for value in ARRAY if value is not None] + [5, [0, 0]],
    },
    "LogWriter.step": {
        "dt_s": [*[value for value in NUMBER if value is not True], 0, -1, 2],
        "position_m": [*ARRAY, 5, [[0, 0, 0]]],
        "quaternion_xyzw": [*ARRAY, 5, [[0, 0, 0, 0]] * 2, [[0, 0, 0, 2]] * 2],
        "pair": ["x", 5, None, object(), {}, [[0, 2]], [[1, 1]], [[-1, 0]], [[0.5, 1]], [0, 1], [[0, 1]] * 2],
        "point_m": [*ARRAY, 5, [0, 0, 0]],
        "normal": [*ARRAY, 5, [[0, 0, 0]], [[0, 0, 2]]],
        "impulse_n_s": [*ARRAY, 5, [0, 0, 0]],
        "gap_m": [value for value in ARRAY if value is not None] + [5, [0, 0]],
        **{name: [*ARRAY, 5, [[0, 0, 0]]] for name in TWISTS},
        "gravity_m_s2": [*ARRAY, 5],
        "moved": ["x", 5, None, object(), [2], [-1], [0.5], ["ball"]],
    },
    "LogWriter.save": {"path": PATH, "models": ["x", None, 5, object(), b"reference"]},
    "Material": {
        "name": TEXT,
        "density_kg_m3": [*NUMBER, 0],
        "stiffness_pa": [*ARRAY, np.zeros((6, 6)), np.ones((3, 3))],
        "alpha_per_s": [*OPTIONAL, -1],
        "beta_s": [*OPTIONAL, -1],
        "roughness_m": [*NUMBER, -1],
        "hurst": [*NUMBER, 0, 1],
        "restitution": [value for value in NUMBER if value is not True] + [-0.1, 1.1],
        "source": TEXT,
        "residual": RECORD,
        "effects": ["x", 5, None, object(), {}],
        "octave_rms_m": ["x", 5, object(), [1e-6], [math.nan] * 14, [-1.0] * 14],
        "form": RECORD,
        "includes_radiation": FLAG,
    },
    "Material.isotropic": {
        "name": TEXT,
        "youngs_pa": [*NUMBER, 0],
        "poisson": [*NUMBER, 0.5, -1],
        "density_kg_m3": [*NUMBER, 0],
    },
    "Ambisonics": {**PLACED_BAD, "order": [*WHOLE, 0, 4]},
    "Binaural": {**PLACED_BAD, "head": [*RECORD, None]},
    "Head": {
        "direction": [*ARRAY, [[0, 0, 0]] * 2, []],
        "response": [*ARRAY, np.ones((2, 3, 4)), np.ones((2, 2, 0)), np.full((2, 2, 4), math.nan)],
        "sr": [*NUMBER, 0],
        "name": TEXT,
    },
    "Microphone": PLACED_BAD,
    "MicrophonePath": {
        "time_s": [*ARRAY, [], [1.0, 1.0]],
        "position_m": [*ARRAY, [[0, 0, 0]]],
        "quaternion_xyzw": [*(value for value in ARRAY if value is not None), [[0, 0, 0, 0]] * 2],
    },
    "ModalModel": {
        **{name: [*ARRAY, 5] for name in ("freq_hz", "shape", "vertex_m", "face", "curvature_per_m")},
        "face": [*ARRAY, [[0, 1, 1.5]] * 4],
        "decay_per_s": ["x", object(), {}, 1j, [[1], [2, 3]]],
        **{name: [*NUMBER, -1] for name in ("volume_m3", "mass_kg", "assumed_wall_m")},
        "dropped": [*WHOLE, -1],
        "note": TEXT,
        **{
            name: [value for value in ARRAY if value is not None]
            for name in ("bend_s2_m2", "damping_growth_s_m", "stands_for")
        },
        "damping_growth_power": NUMBER,
        "includes_radiation": FLAG,
        "solution": [*TEXT, "half", "none"],
        "touched": [value for value in (*TEXT, *ARRAY) if value is not None],
    },
    "ModalSum": {"scale": NUMBER},
    "Shape": {
        "kind": [*TEXT, "ball"],
        **{name: [*ARRAY, 5] for name in ("size_m", "position_m", "quaternion_xyzw", "vertex_m", "face")},
    },
    "Step": {
        "dt_s": [*[value for value in NUMBER if value is not True], 0, -1, 2],
        "position_m": [*ARRAY, 5],
        "quaternion_xyzw": [*ARRAY, 5],
        "teleported": ["x", object(), {}, 1j, [[1], [2, 3]], ["a", "b"], 5],
        "contacts": [*RECORD, None],
        "gravity_m_s2": [*ARRAY, 5],
        "body": [*[value for value in ARRAY if value is not None], 5, [1, 0], [-1, 0], [0, 0], [0.5, 1]],
        "motions": [*ARRAY, 5, np.full(1, 7, LINK_MOTION), np.full(1, -1, LINK_MOTION)],
    },
    "Vibrometer": ON_SURFACE,
    "ContactMicrophone": ON_SURFACE | {"response": ["x", 5, [1], {}, object()], "noise_m_s2_rthz": [*NUMBER, -1]},
    "SensorResponse": {"freq_hz": [*ARRAY, [0, 1], [2, 1]], "magnitude": [*ARRAY, [0, 0], [-1, 1], [1]]},
    "read_response": {"path": PATH},
    "attach": {
        "client": CLIENT,
        "sr": [*NUMBER, 0, 10**9, 44_100.5],
        "microphone": [
            "here",
            5,
            None,
            object(),
            {},
            [(0, 0)],
            (0, 0),
            (0, 0, "z"),
            [(0, 0, 1), (2,)],
            ["a", "b", "c"],
            (0, math.nan, 0),
            sb.Microphone,
        ],
        "seed": [*WHOLE, -1, 10**30],
        "air": RECORD,
        **dict.fromkeys(KEEPS, FLAG),
    },
    "compare": {"a": PATH, "b": PATH, "say": CALL},
    "keep_restitution": {"client": CLIENT},
    "load_material": {"name": [None, 5, b"steel", object(), ["steel"]]},
    "read_audio": {"path": PATH},
    "read_baked": {"path": PATH},
    "read_head": {"path": PATH},
    "read_log": {"path": PATH},
    "read_room_response": {"path": PATH},
    "RoomResponse": {
        "response": [*ARRAY, np.zeros((1, 4)), np.ones((1, 0)), np.full((1, 4), math.nan), np.ones(4)],
        "sr": [*NUMBER, 0],
        "name": TEXT,
    },
    "ShoeboxRoom": {
        "size_m": [*ARRAY, [6, 4], [6, 4, 0]],
        "absorption": [*ARRAY, 0, 1.1, [0.1] * 9],
        "corner_m": [value for value in ARRAY if value is not None],
    },
    "render_log": {
        "log": [*RECORD, None],
        "sr": [*OPTIONAL, 0],
        "residual": ["no", 0, 1.0],
        "room": RECORD,
        "progress": CALL,
        "say": CALL,
    },
    "render_scene": {
        "path": PATH,
        "seconds": [*[value for value in OPTIONAL if value is not True], 0, -1],
        "sr": [*OPTIONAL, 0],
        "seed": [value for value in [*WHOLE, -1] if value is not None],
        "microphones": ["here", 5, object(), [(0, 0)]],
        "material": [5, b"steel", object(), ["steel"]],
        "materials": [5, "steel", b"steel", object(), ["steel"]],
        "fill_modes": FLAG,
        "draft": FLAG,
        "silent": [5, "floor", object(), None],
        "residual": [value for value in FLAG if value is not None],
        "supports": [value for value in FLAG if value is not None],
        "image": [value for value in FLAG if value is not None],
        "at_start": CALL,
        "at_end": CALL,
        "tail_db": [*OPTIONAL, 3, -1e9],
        "client": [value for value in [*WHOLE, -1] if value is not None],
    },
    "write_audio": {
        "path": PATH,
        "samples": ["x", object(), {}, None, [[1], [2, 3]], ["a"], np.ones(3, complex), 5],
        "sr": [*NUMBER, 0],
        "peak_dbfs": [*OPTIONAL, 3, -1e9],
        "lufs": [*OPTIONAL, 1e9],
        "full_scale_pa": [*OPTIONAL, 0],
        "subtype": [5, b"PCM_16", object()],
        "cues": [5, "cue", object(), [5], [object()]],
        "time_reference": [*WHOLE, -1],
    },
}
MENU: list[Any] = [
    *(
        None,
        True,
        0,
        -1,
        1,
        2**31,
        10**400,
        0.5,
        -0.0,
        math.nan,
        math.inf,
        -math.inf,
        1e308,
        5e-324,
        1j,
        np.float32(1),
        np.int8(-1),
        np.bool_(True),
    ),
    *(
        "",
        "x",
        "all",
        "0",
        "a\0b",
        "\ud800",
        "y" * 400,
        b"",
        b"x",
        bytearray(3),
        [],
        [[]],
        [0],
        [0, 0, 0],
        [[0, 0, 0]],
        [[1], [2, 3]],
        [None] * 3,
        ["a"] * 3,
    ),
    *((), {}, {1: 2}, {1}, range(3), object(), object, print, Exception("e"), math, Ellipsis, lambda: 0),
    *(
        np.zeros(0),
        np.zeros((2, 3)),
        np.array(1.0),
        np.array(["a"]),
        np.array([None]),
        np.full(3, 1e308),
        np.zeros(3, complex),
        np.datetime64("2020"),
    ),
    *(STEEL, sb.Air(), sb.Contacts.none(), sb.Microphone([0, 0, 0])),
]


def test_every_argument_of_everything_public_is_looked_at(client: Any, tmp_path: Path) -> None:
    assert {door.split(".")[0] for door in DOORS} | WITHOUT_ARGUMENTS == {*sb.__all__, "render_scene"}
    assert set(BAD) == set(DOORS)
    looked_at = 0
    for door, make in DOORS.items():
        call, good = make(client, tmp_path)
        kinds = inspect.Parameter
        named = {
            name
            for name, one in inspect.signature(call).parameters.items()
            if one.kind not in (kinds.VAR_KEYWORD, kinds.VAR_POSITIONAL)
        }
        assert named <= set(BAD[door]) <= set(good), door
        call(**good)
        looked_at += sum(map(len, BAD[door].values()))
    print(f"{looked_at} bad values at {len(DOORS)} doors")
    assert looked_at > 700


def refusal(call: Callable[..., Any], arguments: dict[str, Any]) -> str | None:
    """What the door says, None where it takes the arguments. Anything but our own error, of one short line, fails."""
    try:
        call(**arguments)
    except SonicBulletError as error:
        said = str(error)
        assert "\n" not in said
        assert len(said) < LONGEST, said
        assert error.remedy, said
        return said
    return None


@pytest.mark.parametrize("door", DOORS)
def test_a_wrong_value_is_refused_by_name(client: Any, tmp_path: Path, door: str) -> None:
    call, good = DOORS[door](client, tmp_path)
    for argument, values in BAD[door].items():
        for value in values:
            said = refusal(call, {**good, argument: value})
            assert said is not None, f"{door}({argument}={value!r}) is taken"
            assert argument in said, said


@pytest.mark.parametrize("door", DOORS)
def test_whatever_is_passed_is_taken_or_refused(
    client: Any, tmp_path: Path, door: str, monkeypatch: pytest.MonkeyPatch
) -> None:
    """A menu of everything at every argument: a result, or our own error."""
    monkeypatch.chdir(tmp_path)
    call, good = DOORS[door](client, tmp_path)
    tried = 0
    for argument in good:
        for value in MENU:
            if argument not in ("progress", "say", "at_start", "at_end") or not callable(
                value
            ):  # a user's function raises what it likes
                refusal(call, {**good, argument: value})
                tried += 1
    assert tried > len(good) * len(MENU) * 0.8


@pytest.mark.parametrize(
    ("argument", "value", "kind"),
    [
        ("link", "arm", SceneError),
        ("material", None, MaterialError),
        ("mesh", 5, MeshError),
        ("count", "x", ModalError),
        ("fixed", [(0, 0, 0)], ModalError),
        ("to_hz", "x", ModalError),
        ("thickness_m", "x", MeshError),
        ("roughness_m", "x", RecordError),
        ("progress", 5, RecordError),
        ("body", True, SceneError),
        ("body", "box", SceneError),
    ],
)
def test_errors_are_of_the_kind_that_the_argument_is_of(
    client: Any, argument: str, value: Any, kind: type[SonicBulletError]
) -> None:
    listener, body = listener_of(client)
    with pytest.raises(kind, match=argument):
        listener.add(**{"body": body, "material": STEEL, argument: value})
    assert not listener.world.bodies


@pytest.mark.parametrize(
    ("options", "words"),
    [
        ({"peak_dbfs": "x"}, "peak_dbfs"),
        ({"peak_dbfs": 3}, "from -200 to 0"),
        ({"peak_db": -1}, "peak_dbfs"),
        ({"colour": 1}, "subtype"),
    ],
)
def test_options_of_write(client: Any, tmp_path: Path, options: dict[str, Any], words: str) -> None:
    """A misspelt option names the near one; a peak above full scale cannot be written."""
    call, _ = writing(client, tmp_path)
    with pytest.raises(AudioError, match=words):
        call(tmp_path / "a.wav", **options)
    assert not list(tmp_path.iterdir())


def test_a_misspelt_constant_names_the_near_one() -> None:
    with pytest.raises(RecordError, match="roughness_m"):
        sb.Material.isotropic("m", youngs_pa=1e9, poisson=0.3, density_kg_m3=1e3, roughnes_m=1e-6)


@pytest.mark.parametrize(
    ("who", "how", "kind", "words"),
    [
        (0, {"materal": STEEL}, RecordError, "material"),
        (0, {5: STEEL}, RecordError, "5"),
        (0, {"roughness_m": 1e-6}, MaterialError, "material"),
        (0, None, MaterialError, "material"),
        ((0, -1, 2), STEEL, SceneError, "body"),
        (("box", "all"), STEEL, SceneError, "body"),
        (b"box", STEEL, SceneError, "body"),
    ],
)
def test_what_a_cast_holds_is_looked_at(client: Any, who: Any, how: Any, kind: type[Exception], words: str) -> None:
    listener, body = listener_of(client)
    with pytest.raises(kind, match=words):
        listener.add_all({body: {"material": STEEL, "model": plate_model()}, who: how})
    assert not listener.world.bodies


def test_numbers_of_every_type_are_taken(client: Any) -> None:
    listener, body = listener_of(client)
    (model,) = listener.add(
        np.int64(body),
        np.int32(-1),
        material=STEEL,
        model=plate_model(),
        roughness_m=np.float32(1e-6),
        to_hz=np.float64(2e4),
        count=5.0,
    )
    assert model.mode_count > 0
    assert type(listener.world.bodies[0].body_id) is int
    assert sb.attach(
        np.int64(client._client), sr=np.float64(44_100), seed=np.uint8(3), microphone=np.array([[0, 0, 1], [1, 0, 1]])
    ).frame.shape == (2, 0)
