"""Sound of a baked animation: poses become contacts, and contacts are rendered as any other.

glTF, JSON, NPZ -> Animation -> contacts of each frame or sub-step -> AnimatedWorld -> Listener -> sound, contact log
                                 >= 120 fps: impulse_fit, below: shooting
"""
