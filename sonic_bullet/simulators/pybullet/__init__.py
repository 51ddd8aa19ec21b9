"""PyBullet worlds: hooks, shapes, scripts and findings; the only package that imports pybullet."""
