"""Bodies in place: what a body that touches others becomes, and what of it passes on to them.

    materials, loads, region of touching -> ContactSpring     springs      N/m, complex: stiffness and loss
    modes, mass, inertia of a body       -> Moving            moving       what it yields where it is pushed
    a body, its partners, its touches    -> InPlace           in_place     poles, mixing, what passes, when it lifts
                                                              first_order  the same in a tenth of the time, nearly

Values in, values out; nothing here knows a scene, a step or a sample. The run time asks anew when a body's set of
touches or their loads change; till then poles stay.
"""

from sonic_bullet.support.first_order import first_order
from sonic_bullet.support.in_place import InPlace, Touch, in_place
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
    "in_place",
    "pad_spring",
    "wide_plate_m_n_s",
]
