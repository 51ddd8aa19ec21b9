# SPDX-FileCopyrightText: 2026 the authors of sonic_bullet
# SPDX-License-Identifier: GPL-3.0-or-later
"""Sound for a Blender scene: rigid bodies and keyframed objects sound by their poses, as sonic_bullet hears them.

This program is free software: you can redistribute it and/or modify it under the terms of the GNU General Public
License as published by the Free Software Foundation, either version 3 of the License, or (at your option) any later
version.

Properties tab > Physics > Sound: what an object is made of. Properties tab > Scene > Sound: microphone, Bake sound.
"""

import tempfile
import textwrap
import time
from pathlib import Path
from typing import Any

import bpy

from .background import HOW_TO_INSTALL, BakeJob, find_command
from .scene_poses import sounding_objects, write_poses
from .sequencer import place_sound

MATERIALS = ("aluminium", "brass", "concrete", "copper", "glass", "metal", "plastic", "porcelain", "rubber", "spruce",
             "steel", "wood")  # fmt: skip

TICK_S = 0.05
"""Between looks at a bake, of which reading poses takes half: the interface has the rest."""


class Running:
    """The bake that is under way, of which there is one."""

    job: BakeJob | None = None
    poses: Any = None
    words: str = ""


class ObjectSound(bpy.types.PropertyGroup):
    """What an object is made of."""

    material: bpy.props.EnumProperty(  # type: ignore[valid-type]
        name="Material",
        items=[("NONE", "As the scene's default", "Plastic where it moves, silent where it does not")]
        + [(name, name.capitalize(), f"sonic_bullet's {name}") for name in MATERIALS]
        + [("FILE", "Preset file …", "A preset that sonic-bullet fit or you wrote")],
        default="NONE",
    )
    preset: bpy.props.StringProperty(name="Preset", subtype="FILE_PATH")  # type: ignore[valid-type]


class SceneSound(bpy.types.PropertyGroup):
    """Where it is heard, and where it is written."""

    microphone: bpy.props.PointerProperty(  # type: ignore[valid-type]
        name="Microphone", type=bpy.types.Object, description="An empty or a camera; none: the scene's camera"
    )
    sound: bpy.props.StringProperty(  # type: ignore[valid-type]
        name="Sound", subtype="FILE_PATH", default="//sonic_bullet.wav"
    )
    stems: bpy.props.BoolProperty(name="A sound of each body, too")  # type: ignore[valid-type]


class Preferences(bpy.types.AddonPreferences):
    """Which Python has sonic_bullet."""

    bl_idname = __package__

    command: bpy.props.StringProperty(  # type: ignore[valid-type]
        name="Python or sonic-bullet", subtype="FILE_PATH", description="Empty: the sonic-bullet on PATH"
    )

    def draw(self, context: Any) -> None:
        """Show the command, and how to install it."""
        self.layout.prop(self, "command")
        if find_command(self.command) is None:
            draw_words(self.layout, context, HOW_TO_INSTALL)


def chosen_command() -> str:
    """Return the preferences' command, "" where the add-on is not installed as one (in tests)."""
    addon = bpy.context.preferences.addons.get(__package__ or "")
    return addon.preferences.command if addon is not None else ""


def microphone_of(scene: Any) -> tuple[float, float, float]:
    """Return where it is heard, in m."""
    ear = scene.sonic_bullet.microphone or scene.camera
    place = ear.matrix_world.translation if ear is not None else (0.0, -1.0, 0.5)
    unit = scene.unit_settings.scale_length if ear is not None else 1.0
    return tuple(unit * x for x in place)  # type: ignore[return-value]


def prepare(scene: Any, command: str = "") -> BakeJob:
    """Make a job for a scene; raises ValueError with a line for the panel."""
    found = find_command(command or chosen_command())
    if found is None:
        raise ValueError(HOW_TO_INSTALL)
    if not sounding_objects(scene):
        raise ValueError("No object has a rigid body: Physics > Rigid Body, passive for what stands still")
    name = scene.sonic_bullet.sound
    if name.startswith("//") and not bpy.data.filepath:
        raise ValueError("Save the .blend file first, or give the sound a full path")
    folder = Path(tempfile.mkdtemp(prefix="sonic_bullet_"))
    sound = Path(bpy.path.abspath(name)).with_suffix(".wav")
    return BakeJob(found, folder, sound, microphone_of(scene), scene.sonic_bullet.stems)


def finish(scene: Any, job: BakeJob) -> Any:
    """Put what a job made into the sequencer; return its strip. Raises RuntimeError where this Blender has no sound."""
    stems = job.sound.with_name(job.sound.stem + "_stems") if job.stems else None
    try:
        return place_sound(scene, job.sound, job.events(), stems)
    finally:
        job.clear()


class BakeSound(bpy.types.Operator):
    """Find what touches in the poses, and let it sound."""

    bl_idname = "sonic_bullet.bake"
    bl_label = "Bake sound"

    _timer: Any = None

    def invoke(self, context: Any, event: Any) -> set[str]:
        """Start: poses first, some frames a tick, then the command, beside."""
        try:
            Running.job = prepare(context.scene)
        except ValueError as error:
            Running.words = str(error)
            self.report({"ERROR"}, Running.words)
            return {"CANCELLED"}
        Running.words, Running.poses = "", write_poses(context.scene, Running.job.poses)
        self._timer = context.window_manager.event_timer_add(TICK_S, window=context.window)
        context.window_manager.modal_handler_add(self)
        return {"RUNNING_MODAL"}

    def modal(self, context: Any, event: Any) -> set[str]:
        """Go on a little."""
        job = Running.job
        if job is None or job.cancelled or event.type == "ESC":
            return self._ended(context, "cancelled")
        if event.type != "TIMER":
            return {"PASS_THROUGH"}
        for area in context.screen.areas:
            if area.type == "PROPERTIES":  # where the panel is: a 3D view may be slow to draw
                area.tag_redraw()
        if Running.poses is not None:
            end = time.monotonic() + TICK_S / 2
            while (done := next(Running.poses, None)) is not None:
                job.said, job.fraction = "reading poses", 0.1 * done
                if time.monotonic() > end:
                    return {"RUNNING_MODAL"}
            Running.poses = None
            job.start()
        if job.running:
            return {"PASS_THROUGH"}
        if job.error:
            self.report({"ERROR"}, job.error)
            return self._ended(context, job.error)
        words = ""
        try:
            finish(context.scene, job)
        except RuntimeError as error:
            words = f"The sound is in {job.sound}. No strip: {error}"
        return self._ended(context, words)

    def _ended(self, context: Any, words: str) -> set[str]:
        context.window_manager.event_timer_remove(self._timer)
        if Running.poses is not None:
            Running.poses.close()
        if Running.job is not None and words:
            Running.job.cancel()
        Running.job, Running.poses, Running.words = None, None, words
        return {"CANCELLED"} if words else {"FINISHED"}


class CancelBake(bpy.types.Operator):
    """End the bake, and leave nothing."""

    bl_idname = "sonic_bullet.cancel"
    bl_label = "Cancel"

    def execute(self, context: Any) -> set[str]:
        """Ask the bake to end."""
        if Running.job is not None:
            Running.job.cancelled = True
        return {"FINISHED"}


class ObjectPanel(bpy.types.Panel):
    """Material of an object."""

    bl_idname = "PHYSICS_PT_sonic_bullet"
    bl_label = "Sound"
    bl_space_type, bl_region_type, bl_context = "PROPERTIES", "WINDOW", "physics"

    @classmethod
    def poll(cls, context: Any) -> bool:
        """Show it for meshes."""
        return context.object is not None and context.object.type == "MESH"

    def draw(self, context: Any) -> None:
        """Show the material, and the bake."""
        item = context.object
        self.layout.use_property_split = True
        if item.rigid_body is None:
            self.layout.label(text="Add a Rigid Body: who has none touches nothing", icon="INFO")
        self.layout.prop(item.sonic_bullet, "material")
        if item.sonic_bullet.material == "FILE":
            self.layout.prop(item.sonic_bullet, "preset")
        draw_bake(self.layout, context)


class ScenePanel(bpy.types.Panel):
    """The bake of a scene."""

    bl_idname = "SCENE_PT_sonic_bullet"
    bl_label = "Sound"
    bl_space_type, bl_region_type, bl_context = "PROPERTIES", "WINDOW", "scene"

    def draw(self, context: Any) -> None:
        """Show the bake."""
        self.layout.use_property_split = True
        draw_bake(self.layout, context)


def draw_bake(layout: Any, context: Any) -> None:
    """Draw microphone, file, button or progress, and the last word."""
    own, job = context.scene.sonic_bullet, Running.job
    for name in ("microphone", "sound", "stems"):
        layout.prop(own, name)
    if job is not None:
        layout.progress(factor=job.fraction, text=job.said[:60])
        layout.operator(CancelBake.bl_idname)
        return
    layout.operator(BakeSound.bl_idname)
    words = HOW_TO_INSTALL if find_command(chosen_command()) is None else Running.words
    if words:
        draw_words(layout, context, words)


def draw_words(layout: Any, context: Any, words: str) -> None:
    """Draw a text in lines as long as the panel is wide: a label shows one line, and leaves out its middle."""
    letter_px = 7 * context.preferences.system.ui_scale
    column = layout.column(align=True)
    for line in textwrap.wrap(words, max(20, int(context.region.width / letter_px) - 4)):
        column.label(text=line)


CLASSES = (ObjectSound, SceneSound, Preferences, BakeSound, CancelBake, ObjectPanel, ScenePanel)


def register() -> None:
    """Add panels and properties."""
    for one in CLASSES:
        bpy.utils.register_class(one)
    bpy.types.Object.sonic_bullet = bpy.props.PointerProperty(type=ObjectSound)
    bpy.types.Scene.sonic_bullet = bpy.props.PointerProperty(type=SceneSound)


def unregister() -> None:
    """Remove them, and what a bake has begun."""
    if Running.job is not None:
        Running.job.cancel()
    del bpy.types.Object.sonic_bullet, bpy.types.Scene.sonic_bullet
    for one in reversed(CLASSES):
        bpy.utils.unregister_class(one)
