"""The physical effects that a model may lack: a file each, or a folder with its search beside it.

`protocol` says what an effect is, `stages` what it acts on, `evidence` what it reads; `presets_of_effects` lists those
that presets hold. An effect from elsewhere is passed with these: `EFFECTS + (Mine,)`.
"""

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
from sonic_bullet.effects.protocol import Effect, Evidence, Impact, ObjectEvidence, Owner, Ring, Sound, Stage
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

__all__ = ["EFFECTS", "Effect", "Evidence", "Impact", "ObjectEvidence", "Owner", "Ring", "Sound", "Stage"]
