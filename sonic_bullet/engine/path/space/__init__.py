"""Sound in space: microphones that move, ambisonics and heads, of what each body sends.

    poses of steps -> receiver_places: where each microphone is, and will be when it hears -> the path's `aim_m`
        -> each body's sound at each microphone, apart -> direction it comes from (hearing_directions)
        -> the engine's ambisonics | ear_filters -> channels, summed over bodies or a body each
space_state: all that the next frame hangs on
"""
