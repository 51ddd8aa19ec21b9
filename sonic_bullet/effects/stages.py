"""Stages at which effects act, and the values of the stages that have no record elsewhere.

MATERIAL  Material   -> Material      stiffness, density: the host solves the modes again
MODES     ModalModel -> ModalModel    frequencies, decays, shapes
FORCE     Impact     -> Impact        times, durations and number of a strike's hits
BANK      Ring       -> Ring          how a vibrating mode depends on its own level
SOUND     Sound      -> Sound         processing on the way to the file
"""

from __future__ import annotations

from dataclasses import dataclass
from enum import Enum

from sonic_bullet.effects.common.pulses import spectrum
from sonic_bullet.records import Array


class Stage(Enum):
    """Stage at which an effect acts, in the order in which sound is made."""

    MATERIAL = "material"
    MODES = "modes"
    FORCE = "force"
    BANK = "bank"
    SOUND = "sound"


@dataclass(frozen=True, slots=True, eq=False)
class Impact:
    """One strike: its hits, each a force pulse.

    Attributes
    ----------
    impulse_n_s : float
        Impulse of the whole strike.
    delay_s : (h,)
        Time of each hit.
    share : (h,)
        Fraction of the impulse in each hit.
    tau_s : float
        Duration of the pulse of a hit, 0 for none.
    pulse : str
        Form of the pulse, one of `pulses.PULSES`, or "impulse".
    """

    impulse_n_s: float
    delay_s: Array
    share: Array
    tau_s: float = 0.0
    pulse: str = "impulse"

    def spectrum(self, freq_hz: Array) -> Array:
        """Compute the fraction of the impulse that modes take from one hit which begins at 0.

        Parameters
        ----------
        freq_hz : (f,)
            Frequencies of the modes.

        Returns
        -------
        (f,) complex
            F̂(f)/F̂(0) of the pulse, the first equation of effects/common/pulses.py.
        """
        return spectrum(self.pulse, self.tau_s, freq_hz)


@dataclass(frozen=True, slots=True, eq=False)
class Ring:
    """Modes as one strike excites them.

    Attributes
    ----------
    freq_hz, decay_per_s : (m,)
        Frequencies and decays.
    amplitude : (m,) complex
        At the sensor.
    level : (m,)
        Peak velocity at the surface in m/s.
    bend : (m,)
        Relative change of frequency is bend·level²; 0 in a linear body.
    damping_growth : (m,)
        Relative change of decay is (damping_growth·level)^damping_growth_power; 0 in a linear body.
    impulse_n_s : float
        Impulse of the strike.
    damping_growth_power : float
        1 or 2.
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
    """Sound of a strike from the onset on.

    Attributes
    ----------
    sample : (n,)
        In units of the file.
    sr : int
        Sampling rate in Hz.
    impulse_n_s : float
        Impulse of the strike; 1 where unknown.
    strike : int
        Index among the fitted strikes, where an effect was fitted to each of them; else -1.
    """

    sample: Array
    sr: int
    impulse_n_s: float
    strike: int = -1  # of the fitted ones, where an effect was fitted to each of them; -1 else
