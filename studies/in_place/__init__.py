"""Bodies in place: what must hold of them, in one table (`python -m studies.in_place`)."""
