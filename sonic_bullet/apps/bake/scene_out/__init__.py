r"""A simulated scene with its sound and its recorded motion as a glTF.

    world before its first step (listener.pybullet.rigid.world_scene) -> RigidScene \
    contact log -> bodies with their models' surfaces (recorded_scene)          -> RigidScene, a path a body
                -> poses at its steps (recorded_scene) -> BodyPath            /
    bodies with modes -> bake_body -> BakedModel (body frame)
    RigidScene, BakedModel, BakedMaterial a body
        -> scene_tree: a node a body, y up; motion, gravityFactor, joints     KHR_physics_rigid_bodies
           colliders: shapes, meshes                                          KHR_implicit_shapes
           bake.gltf_audio: models, materials, surfaces, gains                KHR_audio_rigid_bodies
           animation: paths                                                   glTF 2.0, sec. 3.11
    -> .glb .gltf -> session.gltf_in -> RigidScene: the same to float32

A node is its body's frame: centre of mass, principal axes. So it needs no centerOfMass and no inertiaOrientation.
"""
