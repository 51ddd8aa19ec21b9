"""Images of bodies in large flat faces of others that do not move: a floor, a table-top, a wall."""
