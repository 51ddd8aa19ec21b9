"""A room around a scene: what its walls send back, added to the sound that comes straight.

    ShoeboxRoom + log -> room_fit: where it lies, and whether all is in it
        -> image_microphones: a microphone mirrored at a wall hears what the wall sends back; each body from its own
           place, in motion, by the run time's own path (reciprocity [Allen & Berkley, JASA 65, 1979, eq. 8-10])
        -> beyond them late_field: four microphones on a sphere, whose sound decays as noise
        -> room_plan: sensors = own, images, far ones; mixing = what of them is summed at once
        -> render (Setup.mixing) -> rows: own and flat early sound, early sound by reflections, far sound
        -> room_convolution: rows through their filters -> the log's own channels

No level is chosen: images have 1/r and what walls keep, the late field the energy of the images that it stands for.
"""
