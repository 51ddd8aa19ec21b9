"""Page of a scene: its motion with its sound in step, and every event to be heard alone.

    ContactLog -> stage_log: meshes at poses, 60 a second      -> scene.html.jinja, offline (report.page.assembly)
               -> render_stems: a sound a body, their sum the mix; EventObserver: impacts, rolls, slides

Sounds are FLAC of 16 bits, all of one scale, each with the gain that its own full use of them took.
"""

from __future__ import annotations

import base64
import io
from collections.abc import Sequence
from fractions import Fraction
from pathlib import Path
from typing import TYPE_CHECKING, Any

import numpy as np

from sonic_bullet._engine import SWEEP_FLOOR_M_S
from sonic_bullet.apps.report.page.assembly import encode_array, write_page
from sonic_bullet.apps.soundtrack.staging import Staging, chosen_camera, stage_log
from sonic_bullet.apps.soundtrack.stems import Stem, render_stems
from sonic_bullet.engine.runtime.sound_events import EventObserver, SoundEvent
from sonic_bullet.files.contact_log import ContactLog
from sonic_bullet.records import Array, Microphone
from sonic_bullet.simulators.pictures import PlacedLink

if TYPE_CHECKING:
    from sonic_bullet.engine.path.room.room_plan import RoomPlan

SCENE_PAGE_FORMAT = "sonic-bullet-scene-page/1"
PICTURES_PER_S = 60
LEAST_HEARD_DB = -6.0
"""Where hearing is keenest, at 3150 Hz, half of young people hear no less [ISO 226:2003, table 1: T_f = -6.0 dB]."""
SCENE_SCRIPTS = ("geometry.js", "stage.js", "scene_page.js")


def write_scene_page(
    path: str,
    name: str,
    log: ContactLog,
    sr: int,
    frames: int,
    *,
    standing: Sequence[PlacedLink] = (),
    plan: RoomPlan | None = None,
) -> int:
    """Write a page of a rendered log, whole or not at all; return its size in bytes.

    Parameters
    ----------
    path
        Where.
    name
        The scene's.
    log, sr, frames
        What was rendered, and how many samples of the mix.
    standing
        Shapes that the log lacks.
    plan
        The room around it.

    Raises
    ------
    AudioError
        There is no microphone.
    FileError
        A place that cannot be written.
    SceneError
        There is nothing to draw.
    """
    observer = EventObserver(log)
    stems = render_stems(log, sr=sr, frames=frames, observer=observer, plan=plan)
    seconds = frames / sr
    staging = stage_log(log, Fraction(PICTURES_PER_S), max(int(seconds * PICTURES_PER_S) + 1, 2), standing)
    played, full_scale_pa = _played_stems(stems, sr)
    camera = chosen_camera(log, staging)
    sounding = [one for one in observer.events() if one.kind in ("impact", "roll", "slide") and not one.reason]
    events = [one for one in sounding if _is_heard(one)]
    notes, left = list(staging.notes), len(sounding) - len(events)
    if left:
        notes.append(
            f"{left} contacts are no marks: below {LEAST_HEARD_DB:g} dB SPL, which nobody hears, or slower than "
            f"{1000 * SWEEP_FLOOR_M_S:g} mm/s, at which no surface sounds"
        )
    data = {
        "format": SCENE_PAGE_FORMAT,
        "seconds": seconds,
        "sr": sr,
        "fps": PICTURES_PER_S,
        "pictures": len(staging.position_m),
        "bodies": [body.name for body in log.bodies],
        "eye_m": camera.eye_m.tolist(),
        "target_m": camera.target_m.tolist(),
        "view_deg": camera.view_deg,
        "meshes": [_mesh(staging, k) for k in range(len(staging.meshes))],
        "stems": played,
        "events": [_event(one, log) for one in events],
        "notes": notes,
    }
    title = f"{Path(name).name.removesuffix('.py')}: seen and heard"
    return write_page(path, "scene.html.jinja", SCENE_SCRIPTS, title=title, data=data, full_scale_pa=full_scale_pa)


def _mesh(staging: Staging, k: int) -> dict[str, Any]:
    """Return a mesh and its poses; of one that never moves, one pose."""
    mesh, still = staging.meshes[k], bool(staging.still[k])
    pose = np.concatenate([staging.position_m[:, k], staging.quaternion_xyzw[:, k]], axis=1)
    return {
        "vertex_m": encode_array(mesh.vertex_m, "f4"),
        "face": encode_array(mesh.face, "u4"),
        "colour": list(mesh.colour),
        "pose": encode_array(pose[:1] if still else pose, "f4"),
        "shown": [bool(x) for x in (staging.shown[:1, k] if still else staging.shown[:, k])],
    }


def _played_stems(stems: Sequence[Stem], sr: int) -> tuple[list[dict[str, Any]], float]:
    """Encode the sounds of bodies that sound, two channels at most; and what their 1.0 is, in Pa."""
    quiet, headroom = 10 ** (-100 / 20), 0.8
    peaks = [float(stem.sound.peaks()[:2].max(initial=0.0)) for stem in stems]
    mix: Array | float = 0.0
    for stem in stems:
        mix = mix + stem.sound.samples()[:2]
    loudest = float(np.abs(mix).max(initial=0.0)) or 1.0
    full_scale_pa = loudest / headroom
    made = []
    for stem, peak in zip(stems, peaks, strict=True):
        if peak <= quiet * loudest:
            continue
        flac = _flac(stem.sound.samples()[:2] / peak, sr)
        made.append({"body": stem.index, "gain": peak / full_scale_pa, "flac": flac})
    return made, full_scale_pa


def _flac(x: Array, sr: int) -> str:
    import soundfile

    held = io.BytesIO()
    soundfile.write(held, np.clip(x, -1, 1).T, sr, format="FLAC", subtype="PCM_16")
    return base64.b64encode(held.getvalue()).decode()


def _is_heard(one: SoundEvent) -> bool:
    slow = one.kind != "impact" and one.speed_m_s < SWEEP_FLOOR_M_S
    return not slow and (one.level_db is None or one.level_db >= LEAST_HEARD_DB)


def _event(one: SoundEvent, log: ContactLog) -> dict[str, Any]:
    first = log.sensors[0]
    away_m = float(np.linalg.norm(one.place_m - first.position_m)) if isinstance(first, Microphone) else None
    return {
        "kind": one.kind,
        "start_s": one.start_s,
        "end_s": one.end_s,
        "late_s": one.arrival_s - one.start_s,
        "low": one.low,
        "high": one.high,
        "place_m": one.place_m.tolist(),
        "impulse_n_s": one.impulse_n_s,
        "speed_m_s": one.speed_m_s,
        "level_db": one.level_db,
        "distance_m": away_m,
    }
