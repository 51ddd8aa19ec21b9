"""Does a fitted preset sound as recorded? A strike is rendered, its recording fitted, and the preset struck again.

    python studies/round_trip.py --data ../shared/practice [OBJECT ...]

Each object is played at a microphone and at a vibrometer, with noise 90 dB below the peak. Lines of both renders that
are the same mode are compared: their decays must agree within 3 %, their levels within 0.5 dB. A mode is identified
where it stands three widths apart from its neighbours and a line lies on it whose decay is known to 0.5 %; of a bowl,
whose degenerate modes its mesh splits, there are few. Beside that, decays and levels that the run time plays are
compared of all modes, whether recorded or not, in levels those nearer than a width as one. `thick` fits a plate and
plays the preset on one twice as thick, beside the true material there: 5 %.
"""

from __future__ import annotations

import argparse
import json
import sys
import tempfile
import time
from dataclasses import dataclass
from pathlib import Path

import numpy as np

from sonic_bullet import modal
from sonic_bullet.engine.bank.resonator import build_resonator
from sonic_bullet.engine.runtime.replay import render_log
from sonic_bullet.files import write_audio
from sonic_bullet.files.cases import Case, CaseObject, CaseRecording
from sonic_bullet.files.contact_log import ContactLog
from sonic_bullet.files.presets import load_material, material_of
from sonic_bullet.geometry import closest_point
from sonic_bullet.lab.fit.fitted_preset import preset_of
from sonic_bullet.lab.fit.material_fit import fit_case
from sonic_bullet.lab.lines.joint_lines import joint_lines
from sonic_bullet.lab.lines.line_values import Lines
from sonic_bullet.records import Air, Array, Body, Material, Microphone, ModalModel, Shape, Vibrometer
from sonic_bullet.records.contacts import Contacts, Step
from sonic_bullet.records.errors import SonicBulletError

SR = 48_000
STEP_S = 1 / 240
SECONDS = 1.5
IMPULSE_N_S = 0.01
NOISE = 10 ** (-90 / 20)
MICROPHONE_M = 0.5
LIMIT_DECAY, LIMIT_THICK, LIMIT_DB = 0.03, 0.05, 0.5
PUSH_S = 3e-3  # after the onset: while it is pushed, a body does not ring freely
# widths d/π between modes: nearer ones ring as one line, whose decay is no mode's; but for degenerate modes, which
# decay alike
APART, DEGENERATE = 3.0, 0.1
NEAR = 0.3  # of a width: a line that is the mode
KNOWN = 5e-3  # relative spread of a decay that is known
ROOT = Path(__file__).parents[1]
Places = tuple[Array, Array, Array, Array]
"""Where it is struck, the outward normal there, where a vibrometer looks, the normal there."""


@dataclass(frozen=True)
class Subject:
    """One object: its mesh file, material and strike in the mesh's frame (place, direction)."""

    name: str
    mesh: Path
    material: str


def box_obj(path: Path, size_m: tuple[float, float, float]) -> Path:
    """A box as an OBJ file."""
    corner = (np.array([[x, y, z] for x in (0, 1) for y in (0, 1) for z in (0, 1)], float) - 0.5) * size_m
    face = np.array(
        [
            [0, 1, 3],
            [0, 3, 2],
            [4, 6, 7],
            [4, 7, 5],
            [0, 4, 5],
            [0, 5, 1],
            [2, 3, 7],
            [2, 7, 6],
            [0, 2, 6],
            [0, 6, 4],
            [1, 5, 7],
            [1, 7, 3],
        ]
    )
    rows = [f"v {x:.9g} {y:.9g} {z:.9g}" for x, y, z in corner] + [f"f {a} {b} {c}" for a, b, c in face + 1]
    path.write_text("\n".join(rows) + "\n")
    return path


def subjects(data: Path | None, folder: Path) -> list[Subject]:
    """The bar of scenes/bar.py, the bowl of assets, and the first object of each practice case that is there."""
    made = [
        Subject("bar", box_obj(folder / "bar.obj", (0.24, 0.01, 0.01)), "steel"),
        Subject("bowl", ROOT / "assets" / "bowl.obj", "porcelain"),
    ]
    for case in sorted(data.glob("practice-*/case.json")) if data else ():
        name, thing = next(iter(json.loads(case.read_text())["objects"].items()))
        made.append(Subject(f"{case.parent.name} {name}", case.parent / thing["mesh"], thing["material"]))
    return made


def places(model: ModalModel) -> Places:
    """Where it is struck and where a vibrometer looks, (3,) each, with the outward normals there: two vertices far from
    each other, on faces that look alike.
    """
    from sonic_bullet.effects.common.points import vertex_normals

    normal = vertex_normals(model)
    # edges and corners face nowhere
    flat = np.abs(np.einsum("fi,fci->fc", face_normals(model), normal[model.face])).min(axis=1) > 0.99
    inner = np.unique(model.face[flat])
    middle = model.vertex_m[inner].mean(axis=0)
    direction = np.linalg.svd(model.vertex_m[inner] - middle, full_matrices=False)[2]
    along = (model.vertex_m[inner] - middle) @ (direction[0] + 0.37 * direction[1])
    up = normal[inner] @ direction[2] > 0.7
    up = up if up.sum() > 8 else np.ones(len(inner), bool)
    order = np.flatnonzero(up)[np.argsort(along[up])]
    p, q = inner[order[round(0.97 * (len(order) - 1))]], inner[order[round(0.13 * (len(order) - 1))]]
    return model.vertex_m[p], normal[p], model.vertex_m[q], normal[q]


def face_normals(model: ModalModel) -> Array:
    """Outward unit normals (f, 3)."""
    corner = model.vertex_m[model.face]
    cross = np.cross(corner[:, 1] - corner[:, 0], corner[:, 2] - corner[:, 0])
    return np.asarray(cross / np.linalg.norm(cross, axis=1, keepdims=True))


def body_of(model: ModalModel, material: Material) -> Body:
    """The body, free in space."""
    return Body(0, -1, 0, "object", model.mass_kg, 1e-3 * np.eye(3), model.volume_m3, material=material, model=model)


def rendered(model: ModalModel, material: Material, sensor: str, at: Places) -> Array:
    """The strike's sound (n,) at the sensor: a silent partner pushes once, into the surface."""
    place, out, look, along = at
    striker = Body(1, -1, 0, "striker", 0.0, np.zeros((3, 3)))
    eye: Microphone | Vibrometer = (
        Vibrometer(0, look, along) if sensor == "velocity" else Microphone(MICROPHONE_M * np.array([0.36, 0.48, 0.8]))
    )
    poses, upright = np.zeros((2, 3)), np.tile([0.0, 0.0, 0.0, 1.0], (2, 1))
    still, touching = np.zeros((1, 3)), np.zeros(1)
    hit = Contacts(
        np.array([0]),
        np.array([1]),
        point_a_m=place[None],
        point_b_m=place[None],
        normal=-out[None],
        impulse_n_s=-IMPULSE_N_S * out[None],
        slip_m_s=still,
        sweep_m_s=np.zeros((1, 2)),
        approach_m_s=np.ones(1),
        gap_m=touching,
    )
    steps = [
        Step(STEP_S, poses, upright, np.zeros(2, bool), hit if i == 4 else Contacts.none())
        for i in range(round(SECONDS / STEP_S))
    ]
    (sound,) = render_log(ContactLog((body_of(model, material), striker), tuple(steps), (eye,), SR, 0))
    return np.asarray(sound)


def pushed(sound: Array) -> int:
    """The sample at which the push of a render is over: the same for every render of the same steps."""
    from sonic_bullet.lab.fit.recorded import onset_sample

    return onset_sample(sound, SR) + round(PUSH_S * SR)


def lines_of(sound: Array, start: int) -> Lines:
    """The lines of a render from a sample on."""
    noisy = sound + NOISE * np.abs(sound).max() * np.random.default_rng(7).standard_normal(len(sound))
    return joint_lines(noisy[None, start:], SR, signed=False)


def fitted(subject: Subject, model: ModalModel, sound: Array, sensor: str, at: Places, folder: Path) -> Material:
    """The material of the preset that `fit` makes of the recording."""
    place, out, look, along = at
    noisy = sound + NOISE * np.abs(sound).max() * np.random.default_rng(3).standard_normal(len(sound))
    write_audio(str(folder / "strike.wav"), noisy[None] / np.abs(noisy).max() / 2, SR)
    strike = CaseRecording(folder / "strike.wav", None, "object", "fit", triple(place), triple(-out), IMPULSE_N_S)
    thing = CaseObject("object", subject.mesh, 1.0, subject.material)
    at_m, direction = ({"object": triple(look)}, {"object": triple(along)}) if sensor == "velocity" else (None, None)
    case = Case(subject.name, folder, {"object": thing}, (strike,), sensor, at_m, direction, medium="air")
    return material_of(preset_of(fit_case(case)))


def triple(vector: Array) -> tuple[float, float, float]:
    """A vector (3,) as a case holds it."""
    x, y, z = (float(value) for value in vector)
    return x, y, z


def identified(lines: Lines, model: ModalModel, decay: Array) -> Array:
    """The line (m,) that each mode of a model is, -1 where none is: of modes, degenerate ones as one, that stand apart
    from their neighbours, lines of known decay.

    Apart by their frequencies and widths alone, so that what is compared, decays and levels, has no say in it.
    """
    freq, width = model.freq_hz[: len(decay)], decay / np.pi
    found = np.full(len(freq), -1)
    known = np.flatnonzero(lines.decay_sd_per_s < KNOWN * lines.decay_per_s)
    step = np.diff(freq) / np.maximum(width[1:], width[:-1])
    for who in np.split(np.arange(len(freq)), np.flatnonzero(step > DEGENERATE) + 1) if len(known) else ():
        first, last = who[0], who[-1]
        apart = min(step[first - 1] if first else np.inf, step[last] if last < len(step) else np.inf)
        off = np.abs(lines.freq_hz[known] - freq[who].mean())
        if apart > APART and freq[first] < 20_000 and off.min() < NEAR * width[first]:
            found[first] = known[off.argmin()]
    return found


def compared(first: Lines, again: Lines, which: tuple[Array, Array]) -> tuple[int, float, float]:
    """Modes that lines of both renders are, which (m,) each: how many, and the worst of their decays (relative) and
    levels (dB).
    """
    m = min(len(x) for x in which)
    both = np.flatnonzero((which[0][:m] >= 0) & (which[1][:m] >= 0))
    one, two = (x[both] for x in which)
    decay = np.abs(again.decay_per_s[two] / first.decay_per_s[one] - 1)
    level = 20 * np.abs(np.log10(np.abs(again.amplitude[0, two]) / np.abs(first.amplitude[0, one])))
    return len(both), float(decay.max(initial=0.0)), float(level.max(initial=0.0))


def played(
    model: ModalModel, material: Material, sensor: str = "pressure", at: Places | None = None
) -> tuple[Array, Array]:
    """Decays (m,) that the run time plays, and what the strike starts each mode with at the sensor (m,)."""
    eye = (Vibrometer(0, at[2], at[3]),) if at is not None and sensor == "velocity" else ()
    resonator = build_resonator(body_of(model, material), eye, 4 * SR, Air())
    if at is None:
        return resonator.decay_per_s, np.ones(resonator.mode_count)
    face, barycentric, _ = closest_point(model.vertex_m, model.face, at[0][None], at[1][None])
    push = np.einsum("c,cxm,x->m", barycentric[0], resonator.shape[model.face[face[0]]].astype(float), -at[1])
    return resonator.decay_per_s, np.abs(push * resonator.weight[len(eye)])  # the far field, or the vibrometer


def off(a: Array, b: Array, to_hz: Array) -> float:
    """Largest relative difference of decays of modes that are the same, by their order, below 20 kHz."""
    m = min(len(a), len(b), int((to_hz < 20_000).sum()))
    return float(np.abs(b[:m] / a[:m] - 1).max())


def off_db(a: Array, b: Array, freq_hz: Array, decay: Array) -> float:
    """Largest difference of levels, of modes nearer than a width taken together, from the strongest down to 60 dB
    below.
    """
    m = min(len(a), len(b), int((freq_hz < 20_000).sum()))
    step = np.diff(freq_hz[:m]) / (np.maximum(decay[1:m], decay[: m - 1]) / np.pi)
    start = np.concatenate([[0], np.flatnonzero(step > 1) + 1])
    one, two = (np.add.reduceat(x[:m] ** 2, start) for x in (a, b))
    loud = one > 1e-6 * one.max()
    return float(np.abs(10 * np.log10(two[loud] / one[loud])).max())


def around(subject: Subject, sensor: str, folder: Path) -> tuple[int, float, float, float, float]:
    """Modes identified in both, their worst decay and level, and the worst decay and level of all modes that are
    played.
    """
    shape = modal.read_mesh(subject.mesh)
    truth = load_material(subject.material)
    model = modal.analyse((shape,), truth)
    at = places(model)
    sound = rendered(model, truth, sensor, at)
    found = fitted(subject, model, sound, sensor, at, folder)
    anew = modal.analyse((shape,), found)
    again = rendered(anew, found, sensor, at)
    (one, first), (two, second) = played(model, truth, sensor, at), played(anew, found, sensor, at)
    start = pushed(sound)
    lines = lines_of(sound, start), lines_of(again, start)
    which = identified(lines[0], model, one), identified(lines[1], anew, two)
    return *compared(*lines, which), off(one, two, model.freq_hz), off_db(first, second, model.freq_hz, one)


def thicker(
    folder: Path, sensor: str, name: str = "glass", size_m: tuple[float, float, float] = (0.2, 0.15, 0.004)
) -> float:
    """Worst decay of a plate twice as thick, played with what was fitted on the thin one."""
    thin = Subject("plate", box_obj(folder / "thin.obj", size_m), name)
    truth, shape = load_material(name), modal.read_mesh(thin.mesh)
    model = modal.analyse((shape,), truth)
    at = places(model)
    found = fitted(thin, model, rendered(model, truth, sensor, at), sensor, at, folder)
    thick: Shape = modal.read_mesh(box_obj(folder / "thick.obj", (*size_m[:2], 2 * size_m[2])))
    one, two = (modal.analyse((thick,), x) for x in (truth, found))
    return off(played(one, truth)[0], played(two, found)[0], one.freq_hz)


def main() -> int:
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0] if __doc__ else "")
    parser.add_argument("--data", type=Path)
    parser.add_argument("objects", nargs="*", metavar="OBJECT", help="parts of names; 'thick' for the plates")
    asked = parser.parse_args()
    missed = 0
    print(
        "| object | sensor | modes | decay % | level dB | all modes' decay % | level dB | | wall s |\n"
        "|---|---|---|---|---|---|---|---|---|"
    )
    with tempfile.TemporaryDirectory() as place:
        folder = Path(place)
        for subject in subjects(asked.data, folder):
            if asked.objects and not any(part in subject.name for part in asked.objects):
                continue
            for sensor in ("pressure", "velocity"):
                begun = time.monotonic()
                try:
                    count, decay, level, every, every_db = around(subject, sensor, folder)
                except SonicBulletError as error:
                    print(f"| {subject.name} | {sensor} | | | | | | {error} | |", flush=True)
                    missed += 1
                    continue
                held = max(decay, every) <= LIMIT_DECAY and max(level, every_db) <= LIMIT_DB
                missed += not held
                spent = time.monotonic() - begun
                print(
                    f"| {subject.name} | {sensor} | {count} | {100 * decay:.2f} | {level:.3f} | "
                    f"{100 * every:.2f} | {every_db:.3f} | {'met' if held else 'missed'} | {spent:.0f} |",
                    flush=True,
                )
        for name in ("glass", "steel") if not asked.objects or "thick" in asked.objects else ():
            for sensor in ("pressure", "velocity"):
                worst = thicker(folder, sensor, name)
                missed += not worst <= LIMIT_THICK
                print(
                    f"| {name} plate, twice as thick | {sensor} | | | | {100 * worst:.2f} | | "
                    f"{'met' if worst <= LIMIT_THICK else 'missed'} | |",
                    flush=True,
                )
    print(f"\n{missed} missed")
    return 1 if missed else 0


if __name__ == "__main__":
    sys.exit(main())
