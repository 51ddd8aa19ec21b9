"""A glTF scene with physics and sound, run: read by value, made bodies of a simulator, listened to.

tree -> node frames -> colliders, materials, joints (physics)  \
         -> modal models, acoustic materials, surfaces (audio)      -> RigidScene -> simulator -> Listener
"""
