"""Where effects act: the stages in which sound is made, and the values of those that have none elsewhere.

MATERIAL  Material   -> Material      stiffness, density: the host solves the modes again
MODES     ModalModel -> ModalModel    frequencies, decays, shapes
FORCE     Impact     -> Impact        when, how long, how often a strike presses
BANK      Ring       -> Ring          how a ringing mode depends on its own level
SOUND     Sound      -> Sound         what happens on the way to the file
"""

from __future__ import annotations

from dataclasses import dataclass
from enum import Enum

from sonic_bullet.records import Array


class Stage(Enum):
    """Where an effect acts, in the order in which sound is made."""

    MATERIAL = "material"
    MODES = "modes"
    FORCE = "force"
    BANK = "bank"
    SOUND = "sound"


@dataclass(frozen=True, slots=True, eq=False)
class Impact:
    """A strike of impulse_n_s: h hits after delay_s (h,), each with share (h,) of it, each a pulse of the duration
    tau_s, 0 for none. pulse: see `pulses`.
    """

    impulse_n_s: float
    delay_s: Array
    share: Array
    tau_s: float = 0.0
    pulse: str = "impulse"

    def spectrum(self, freq_hz: Array) -> Array:
        """Complex share (f,) of the impulse that a mode at freq_hz takes from one hit, the hit beginning at 0."""
        from sonic_bullet.effects.common.pulses import spectrum

        return spectrum(self.pulse, self.tau_s, freq_hz)


@dataclass(frozen=True, slots=True, eq=False)
class Ring:
    """m modes as one strike starts them: freq_hz, decay_per_s (m,), amplitude (m,) complex at the sensor; level (m,):
    peak velocity at the surface in m/s.

    bend, damping_growth (m,): relative change of frequency bend·level², of decay
    (damping_growth·level)^damping_growth_power, 1 or 2; 0 in a linear body.
    """

    freq_hz: Array
    decay_per_s: Array
    amplitude: Array
    level: Array
    bend: Array
    damping_growth: Array
    impulse_n_s: float = 1.0
    damping_growth_power: float = 1.0


@dataclass(frozen=True, slots=True, eq=False)
class Sound:
    """A strike's sound (n,) in units of the file, from the onset on, and what made it.

    impulse_n_s: 1 where unknown. direct (n,): the first sound, untouched.
    """

    sample: Array
    sr: int
    impulse_n_s: float
    strike: int = -1  # of the fitted ones, where an effect was fitted to each of them; -1 else
