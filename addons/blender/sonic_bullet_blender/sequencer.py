# SPDX-FileCopyrightText: 2026 the authors of sonic_bullet
# SPDX-License-Identifier: GPL-3.0-or-later
"""A sound as a strip of the sequencer, and what is heard in it as markers."""

from __future__ import annotations

from pathlib import Path
from typing import Any

import bpy

STRIP_NAME, MARK = "sonic_bullet", "♪ "


def place_sound(scene: bpy.types.Scene, sound: Path, events: list[dict[str, Any]], stems: Path | None = None) -> Any:
    """Mark events; put a sound at the scene's first frame, in place of the one before. Returns its strip."""
    fps = scene.render.fps / scene.render.fps_base
    for old in [one for one in scene.timeline_markers if one.name.startswith(MARK)]:
        scene.timeline_markers.remove(old)
    for one in events:
        name = f"{MARK}{one['kind']} {one['name_a']} – {one['name_b']}"
        scene.timeline_markers.new(name, frame=scene.frame_start + round(one["start_s"] * fps))
    editor = scene.sequence_editor or scene.sequence_editor_create()
    strips = editor.strips if hasattr(editor, "strips") else editor.sequences  # 5.x, 4.2 LTS
    for old in [one for one in strips if one.name.startswith(STRIP_NAME)]:
        strips.remove(old)
    channel = 1 + max((one.channel for one in strips), default=0)
    strip = strips.new_sound(STRIP_NAME, str(sound), channel, scene.frame_start)
    for number, file in enumerate(sorted(stems.glob("*.wav")) if stems is not None else [], start=1):
        stem = strips.new_sound(f"{STRIP_NAME} {file.stem}", str(file), channel + number, scene.frame_start)
        stem.mute = True  # the mix sounds; a stem is there to be taken in its place
    return strip
