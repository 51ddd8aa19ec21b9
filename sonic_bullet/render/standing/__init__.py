"""Resting contacts: contact patches, and the poles of bodies on them."""
