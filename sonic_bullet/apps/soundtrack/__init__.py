"""Products of an animation or a scene beside its mix: a film, stems per body, and a table of sound events.

ContactLog -> stems, events (engine/runtime/sound_events.py) -> files a body, tables, cue points
           -> poses at each frame -> pictures (listener), contacts drawn in -> film (film_writer.py)

Animation -> score/ -> contacts -> ContactLog, rendered as any other
"""
