"""The only place that imports pybullet: worlds, hooks, shapes, scripts, and what would spoil their sound."""
