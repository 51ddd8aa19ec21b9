"""Coupled modes: a body's modes while it touches others, and what it transmits to them.

    materials, loads, contact region     -> ContactSpring     springs      N/m, complex: stiffness and loss
    modes, mass, inertia of a body       -> Moving            moving       its driving-point mobility
    a body, its partners, its touches    -> InPlace           in_place     its records
                                                              first_order  poles, mixing, transmission, separation

Values in, values out: no scene, step or sample. The run time calls it when a body's set of touches or their loads
change; until then poles stay.
"""

from sonic_bullet.support.first_order import first_order
from sonic_bullet.support.in_place import InPlace, Touch
from sonic_bullet.support.moving import Moving, Place, wide_plate_m_n_s
from sonic_bullet.support.springs import ContactSide, ContactSpring, Region, contact_spring, pad_spring

__all__ = [
    "ContactSide",
    "ContactSpring",
    "InPlace",
    "Moving",
    "Place",
    "Region",
    "Touch",
    "contact_spring",
    "first_order",
    "pad_spring",
    "wide_plate_m_n_s",
]
