"""Contacts become forces: strikes, rolling and sliding, and springs that couple the bodies at rest.

The stage itself is the engine's, src/contact, one file each:

    contact rows of a step -> contact_rows: pairs and their histories of load; contact_place: where on both surfaces
      -> load_splitting: what lasts is support, what is shorter a strike; friction is what moves under support
           strike  -> strike_forces: its impulse and its pulse on both bodies' modes; strike_cause: how much of it has
                      a cause; strike_timing: its time in the step; pulse_shape: length and shape; hertz: their law
           sliding -> friction: loads and speeds at audio rate; contact_oscillator: f - N of each pair that touches;
                      profile, track, octave_heights: heights of the surfaces it sweeps
           support -> contact_patches: points tracked and loads smoothed; coupling: springs, mobility, new poles

Values and tables in, forces out: no scene, no sample of sound. `bank` plays the forces on modes. What is in Python here
is computed once a body or a scene.
"""
