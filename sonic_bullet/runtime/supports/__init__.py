"""Resting contacts: points of contact patches on both bodies, and the poles of bodies on them."""
