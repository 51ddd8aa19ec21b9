"""Sound path: what bodies emit arrives at microphones, each body from its own place and in its own time.

propagation: travel time, 1/r and direction in free air: its tables, on which the engine works (src/path)
images: faces that mirror | room: walls and late field | space: moving microphones, ambisonics, heads
surface: sensors that touch a body | minimum_phase: filters of which the magnitude is known
"""
