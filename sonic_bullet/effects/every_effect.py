"""All effects, in the order in which a diagnosis tries them."""

from __future__ import annotations

from sonic_bullet.effects.added_mass import AddedMass
from sonic_bullet.effects.amplitude_damping import AmplitudeDamping
from sonic_bullet.effects.amplitude_pitch import AmplitudePitch
from sonic_bullet.effects.contact_time import ContactTime
from sonic_bullet.effects.damping_law import DampingLaw
from sonic_bullet.effects.foreign_mode import ForeignMode
from sonic_bullet.effects.measurement_chain import MeasurementChain
from sonic_bullet.effects.mode_splitting import ModeSplitting
from sonic_bullet.effects.orthotropy import Orthotropy
from sonic_bullet.effects.protocol import Effect
from sonic_bullet.effects.radiation import Radiation
from sonic_bullet.effects.rebound import Rebound
from sonic_bullet.effects.room import Room
from sonic_bullet.effects.support_damping import SupportDamping

EFFECTS: tuple[type[Effect], ...] = (
    DampingLaw,
    SupportDamping,
    ContactTime,
    ModeSplitting,
    AmplitudePitch,
    AmplitudeDamping,
    Room,
    ForeignMode,
    Orthotropy,
    AddedMass,
    Rebound,
    Radiation,
    MeasurementChain,
)
