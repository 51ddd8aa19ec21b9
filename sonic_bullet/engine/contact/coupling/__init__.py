"""Coupled modes: a body's modes while it touches others, and what it transmits to them.

    materials, loads, contact region     -> ContactSpring  springs        N/m, complex: stiffness and loss
    modes, mass, inertia of a body       -> BodyMobility   mobility       its driving-point mobility
    a body, its partners, its touches    -> CoupledModes   coupled_modes  its records
                                                           first_order    poles, mixing, transmission, separation

Values in, values out: no scene, step or sample. The run time calls it when a body's set of touches or their loads
change; until then poles stay.
"""

from sonic_bullet.engine.contact.coupling.coupled_modes import ContactPoint, CoupledModes
from sonic_bullet.engine.contact.coupling.first_order import first_order
from sonic_bullet.engine.contact.coupling.mobility import BodyMobility, BodyPoint
from sonic_bullet.engine.contact.coupling.springs import ContactSide, ContactSpring, Region, contact_spring

__all__ = [
    "BodyMobility",
    "BodyPoint",
    "ContactPoint",
    "ContactSide",
    "ContactSpring",
    "CoupledModes",
    "Region",
    "contact_spring",
    "first_order",
]
