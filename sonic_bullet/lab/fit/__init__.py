"""From lines and a mesh to a material: pairing, Rayleigh damping, verdict, preset."""
