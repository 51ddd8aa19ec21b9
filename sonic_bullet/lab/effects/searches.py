"""Who looks for an effect: the laboratory's search of the package's own, the effect's `propose` of any other.

evidence -> propose(kind) -> effect with its numbers, or None
lines in a room -> dereverberated(room) -> lines as they would be without it;  recordings -> identified_from(room)
"""

from __future__ import annotations

from collections.abc import Callable

from sonic_bullet.effects.added_mass import AddedMass
from sonic_bullet.effects.amplitude_damping import AmplitudeDamping
from sonic_bullet.effects.amplitude_pitch import AmplitudePitch
from sonic_bullet.effects.contact_time import ContactTime
from sonic_bullet.effects.damping_law import DampingLaw
from sonic_bullet.effects.foreign_mode import ForeignMode
from sonic_bullet.effects.measurement_chain import MeasurementChain
from sonic_bullet.effects.mode_splitting import ModeSplitting
from sonic_bullet.effects.orthotropy import Orthotropy
from sonic_bullet.effects.protocol import Dereverberates, Effect
from sonic_bullet.effects.radiation import Radiation
from sonic_bullet.effects.rebound import Rebound
from sonic_bullet.effects.room import Room
from sonic_bullet.effects.support_damping import SupportDamping
from sonic_bullet.lab.effects.added_mass import propose_added_mass
from sonic_bullet.lab.effects.amplitude_damping import propose_amplitude_damping
from sonic_bullet.lab.effects.amplitude_pitch import propose_amplitude_pitch
from sonic_bullet.lab.effects.contact_time import propose_contact_time
from sonic_bullet.lab.effects.damping_law import propose_damping_law
from sonic_bullet.lab.effects.evidence import Evidence, ObjectEvidence
from sonic_bullet.lab.effects.foreign_mode import propose_foreign_mode
from sonic_bullet.lab.effects.measurement_chain import propose_measurement_chain
from sonic_bullet.lab.effects.mode_splitting import propose_mode_splitting
from sonic_bullet.lab.effects.orthotropy import propose_orthotropy
from sonic_bullet.lab.effects.radiation import propose_radiation
from sonic_bullet.lab.effects.rebound import propose_rebound
from sonic_bullet.lab.effects.room import identified_room, propose_room, without_room
from sonic_bullet.lab.effects.support_damping import propose_support_damping
from sonic_bullet.records import Array
from sonic_bullet.signal.log_spectral import Floor

SEARCHES: dict[type[Effect], Callable[[Evidence], Effect | None]] = {
    AddedMass: propose_added_mass,
    AmplitudeDamping: propose_amplitude_damping,
    AmplitudePitch: propose_amplitude_pitch,
    ContactTime: propose_contact_time,
    DampingLaw: propose_damping_law,
    ForeignMode: propose_foreign_mode,
    MeasurementChain: propose_measurement_chain,
    ModeSplitting: propose_mode_splitting,
    Orthotropy: propose_orthotropy,
    Radiation: propose_radiation,
    Rebound: propose_rebound,
    Room: propose_room,
    SupportDamping: propose_support_damping,
}
"""Of each of the package's own effects."""


def propose(kind: type[Effect], evidence: Evidence) -> Effect | None:
    """Fit an effect of a kind to the evidence; None where the evidence suggests none."""
    search = SEARCHES.get(kind)
    return kind.propose(evidence) if search is None else search(evidence)


def dereverberate(effect: Dereverberates, observed: ObjectEvidence, *, foreign: bool = True) -> ObjectEvidence:
    """Return the lines as they would be without an effect that hides decays and levels; foreign: of no mode, too."""
    if isinstance(effect, Room):
        return without_room(effect, observed, foreign=foreign)
    return effect.dereverberate(observed)


def identified_from(
    effect: Dereverberates, signal: Array, sound: Array, noise: Floor, sr: int, *, fully: bool = False
) -> Dereverberates:
    """Identify the effect's response from recordings: see `Dereverberates.identified_from`."""
    if isinstance(effect, Room):
        return identified_room(effect, signal, sound, noise, sr, fully=fully)
    return effect.identified_from(signal, sound, noise, sr, fully=fully)
