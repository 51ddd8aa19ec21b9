"""Radiation of a body's modes: the pressure of each at 1 m, and its radiation damping.

ModalModel + Air -> near_mesh -> entrained_mass, surface_waves (near field) -> far_field
    -> pressure weight, radiation damping
    -> radiated: the same, cached
"""
