"""A baked animation gets its sound: poses become contacts, and contacts go the way of any other.

glTF, JSON, NPZ -> Animation -> contacts of each frame or sub-step -> AnimatedWorld -> Listener -> sound, contact log
                                 >= 120 fps: impulse_fit, below: shooting
"""
