"""Shapes and mesh files -> closed solids filled with tetrahedra or prisms."""
