"""A scene's sounds as clips of KHR_audio_emitter: an emitter on each body that sounds, for viewers that play no modes.

    ContactLog, a microphone 1 m from each body that moves with it -> render_per_body -> pressure at 1 m, p(t)
        -> clip from the animation's first instant on: WAV, 16 bits, over its own peak; source gain = peak/full scale
        -> emitter "positional", inverse distance from 1 m on: p(t)/r

The draft has no time at which a source begins, only `autoPlay` when the file is loaded, so a clip is as long as the
animation and ringing, and lies in step with it where a viewer starts both at once. What a metre's travel delays is cut.
Its text says `autoPlay`, its schema `autoplay`; a node had one `emitter`, and has a list `emitters` since April 2026
(pull request 2137 of Khronos' glTF, read in November 2026): both of both are written.
"""

from __future__ import annotations

import io
from collections.abc import Sequence
from dataclasses import dataclass, replace
from typing import Any

import numpy as np

from sonic_bullet.engine.runtime.body_stems import render_per_body
from sonic_bullet.files.contact_log import ContactLog
from sonic_bullet.files.gltf.gltf_writer import GltfBuffer
from sonic_bullet.records import Array, Body, Microphone
from sonic_bullet.session.gltf_in.own_words import EXTRAS

EMITTER_EXTENSION = "KHR_audio_emitter"


@dataclass(frozen=True, slots=True, eq=False)
class BodyClip:
    """Pressure (n,) in Pa of a body at 1 m from its centre, from the log's first instant on; body: in its scene."""

    body: int
    name: str
    pressure_pa: Array
    sr: int


def render_clips(log: ContactLog, members: Sequence[Body | None]) -> tuple[BodyClip, ...]:
    """Render the clips of a scene's bodies that sound.

    Parameters
    ----------
    log : ContactLog
    members : sequence of Body or None
        Of each body of the scene the log's record.
    """
    at_once, ring_s, away_m, quiet = 8, 3.0, 1.0, 10 ** (-60 / 20)
    # cos² to each of three axes is 1/3, its mean over directions: so much of each a body's click, a dipole, has there
    ear_m = np.full(3, away_m / np.sqrt(3))
    sounding = [(number, body) for number, body in enumerate(members) if body is not None and body.model is not None]
    late = round(away_m / log.air.sound_speed_m_s * log.sr)
    frames = round((log.duration_s + ring_s) * log.sr) + late
    made: list[BodyClip] = []
    for first in range(0, len(sounding), at_once):
        some = sounding[first : first + at_once]
        ears = tuple(Microphone(ear_m, body_id=body.body_id, link=body.link) for _, body in some)
        mine = [
            {i for i, one in enumerate(log.bodies) if (one.body_id, one.link) == (body.body_id, body.link)}
            for _, body in some
        ]
        parts: list[list[Array]] = [[] for _ in some]
        for who, block in render_per_body(replace(log, sensors=ears, image=False), frames=frames):
            for channel, records in enumerate(mine):
                rows = [row for row, index in enumerate(who.tolist()) if index in records]
                parts[channel].append(block[rows, channel].sum(axis=0))
        for (number, body), blocks in zip(some, parts, strict=True):
            sound = np.concatenate(blocks)[late:]
            peak = float(np.abs(sound).max(initial=0.0))
            if peak > 0:
                last = int(np.flatnonzero(np.abs(sound) > quiet * peak)[-1]) + 1
                made.append(BodyClip(number, body.name, _fade_out_end(sound[:last], log.sr), log.sr))
    return tuple(made)


def _fade_out_end(sound: Array, sr: int) -> Array:
    """Return the sound with its last 20 ms faded, so that its end does not click."""
    fade_s = 0.02
    count = min(round(fade_s * sr), len(sound))
    curve = np.ones(len(sound))
    curve[len(sound) - count :] = np.linspace(1, 0, count)
    return sound * curve


def add_emitters(
    clips: Sequence[BodyClip], nodes: Sequence[dict[str, Any]], node_of: Sequence[int], buffer: GltfBuffer
) -> dict[str, Any]:
    """Add an emitter to each sounding body's node; return the document's part of the extension, {} without any."""
    if not clips:
        return {}
    peaks = [float(np.abs(clip.pressure_pa).max()) for clip in clips]
    full_scale_pa = max(peaks)
    audio: list[dict[str, Any]] = []
    sources: list[dict[str, Any]] = []
    emitters: list[dict[str, Any]] = []
    for number, (clip, peak) in enumerate(zip(clips, peaks, strict=True)):
        view = buffer.append_bytes(_wav(clip.pressure_pa / peak, clip.sr))
        audio.append({"name": clip.name, "bufferView": view, "mimeType": "audio/wav"})
        sources.append(
            {
                "name": clip.name,
                "audio": number,
                "gain": peak / full_scale_pa,
                "autoPlay": True,
                "autoplay": True,
                "extras": {EXTRAS: {"full_scale_pa": full_scale_pa}},
            }
        )
        positional = {
            "shapeType": "omnidirectional",
            "distanceModel": "inverse",
            "refDistance": 1.0,
            "rolloffFactor": 1.0,
        }
        emitters.append({"name": clip.name, "type": "positional", "sources": [number], "positional": positional})
        nodes[node_of[clip.body]].setdefault("extensions", {})[EMITTER_EXTENSION] = {
            "emitter": number,
            "emitters": [number],
        }
    return {"audio": audio, "sources": sources, "emitters": emitters}


def _wav(samples: Array, sr: int) -> bytes:
    import soundfile

    held = io.BytesIO()
    soundfile.write(held, samples, sr, format="WAV", subtype="PCM_16")
    return held.getvalue()
