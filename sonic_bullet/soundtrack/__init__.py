"""What an animation or a scene gets besides its mix: a film, a file a body, and when what sounded.

ContactLog -> stems, events (sound_events.py) -> files a body, tables, cue points
           -> poses at each frame -> pictures (listener), contacts drawn in -> film (film_writer.py)

Animation -> score/ -> contacts -> ContactLog, which goes the way of any other
"""
