"""MuJoCo worlds: links, forces, steps; the only package that imports mujoco."""
