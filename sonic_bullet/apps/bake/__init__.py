r"""A body's modal sound in a file for other engines.

    mesh + material -> session.body_models -> Body \
    scene, log      ->                        Body -> bank.resonator: decays with the air's, pressure at 1 m
        -> mode_importance: order, masked and weak modes
        -> sample_points: the user's own vertices, fewer or more -> shapes there
        -> BakedModel
    BakedModel -> gltf_models  .glb .gltf  KHR_audio_rigid_bodies, doubles and what it lacks in `extras`  -> BakedModel
               -> json_models  .json       docs/reference/baked.schema.json                               -> BakedModel
               -> page         .html       struck and seen in a browser, offline
               -> faust_bank   .dsp        struck by a button
               -> c_bank       .h          a bank of resonators
               -> strike_playback -> .wav  one strike at 1 m, in pascals

All numbers are in the mesh's own frame, as the user's file has it, in SI units; m modes, p points, f triangles.
"""

from sonic_bullet.apps.bake.baked_model import BakedMaterial, BakedModel, MassProperties
from sonic_bullet.apps.bake.baking import bake_body, bake_mesh
from sonic_bullet.apps.bake.formats import read_baked, write_baked
from sonic_bullet.apps.bake.strike_playback import BakedStrike, choose_strike, render_strike
from sonic_bullet.options.bake import PruningOptions

__all__ = [
    "BakedMaterial",
    "BakedModel",
    "BakedStrike",
    "MassProperties",
    "PruningOptions",
    "bake_body",
    "bake_mesh",
    "choose_strike",
    "read_baked",
    "render_strike",
    "write_baked",
]
