"""The thirteen effects by id, and those on no list.

Each makes an Effect of a strength (0 weak, 1 medium, 2 strong), drawing its form by chance.
"""

from benchmarks.suite.effects import blow, body, sound, unlisted
from benchmarks.suite.effects.base import CARRIED, Effect, Maker, Scene

LISTED: dict[str, Maker] = {
    "damping-law": body.damping_law,
    "support-damping": body.support_damping,
    "contact-time": blow.contact_time,
    "mode-splitting": body.mode_splitting,
    "amplitude-pitch": blow.amplitude_pitch,
    "amplitude-damping": blow.amplitude_damping,
    "room": sound.room,
    "foreign-mode": sound.foreign_mode,
    "orthotropy": body.orthotropy,
    "added-mass": body.added_mass,
    "rebound": blow.rebound,
    "radiation": body.radiation,
    "measurement-chain": sound.measurement_chain,
}
UNLISTED: dict[str, Maker] = {
    "drift": unlisted.drift,
    "doppler": unlisted.doppler,
    "buzz": unlisted.buzz,
    "octaves": unlisted.octaves,
    "string": unlisted.string,
    "tremolo": unlisted.tremolo,
}

__all__ = ["CARRIED", "LISTED", "UNLISTED", "Effect", "Maker", "Scene"]
