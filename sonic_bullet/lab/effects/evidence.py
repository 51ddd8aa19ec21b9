"""What an effect reads: objects' lines, models and recordings.

strikes of a case -> ObjectEvidence, one an object;  objects, material, effects found so far -> Evidence -> `propose`
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass
from typing import TYPE_CHECKING, Any

import numpy as np

from sonic_bullet.records import Array, Material, ModalModel
from sonic_bullet.signal.log_spectral import Floor

if TYPE_CHECKING:
    from sonic_bullet.effects.protocol import Effect


@dataclass(frozen=True, slots=True, eq=False)
class Elastic:
    """A body under any orthotropic elasticity, its axes the mesh's.

    Attributes
    ----------
    material : Material
        Isotropic, as the baseline has it, with the guessed density.
    phased : bool
        Whether the signs of lines' amplitudes are comparable with those of J ψ.
    look : callable
        C/ρ (6, 6) in m²/s² -> undamped freq_hz (m,), slopes, J ψ (s, m) up to a factor, NaN for strikes without place.
        The slopes are a function from modes (k,) to ∂ ln λ/∂(C_i/ρ) (9, k), constants as in `Orthotropy`.
    solve : callable
        C/ρ (6, 6) -> undamped ModalModel, strikes and sensor as last vertices.
    """

    material: Material
    phased: bool
    look: Callable[[Array], tuple[Array, Callable[[Array], Array], Array]]
    solve: Callable[[Array], ModalModel]


@dataclass(frozen=True, slots=True, eq=False)
class Poisson:
    """A body at any Poisson's ratio ν, its E/ρ the baseline's.

    Attributes
    ----------
    fitted : float
        The baseline's ν.
    guess, sd : float
        The estimate before the fit, and its spread.
    at : callable
        ν -> undamped freq_hz (m,), and the modes there as sums (m, m) of the baseline's, a column a mode.
    """

    fitted: float
    guess: float
    sd: float
    at: Callable[[float], tuple[Array, Array]]


@dataclass(frozen=True, slots=True, eq=False)
class ObjectEvidence:
    """Strikes of one object: k lines that are modes, what the model so far expects of them, and what it leaves.

    Attributes
    ----------
    impulse_n_s : (s,)
        Impulses of the strikes, NaN where unknown.
    freq_hz, decay_per_s, freq_sd_hz, decay_sd_per_s : (k,)
        The lines and their spreads.
    amplitude, amplitude_sd : (s, k)
        Complex at the onset, and its spread.
    mode : tuple of arrays
        The modes of `model` that each line represents.
    model_hz : (k,)
        The mesh's own frequencies, without corrections.
    expected_decay_per_s, expected : (k,), (s, k)
        Of the model with the effects found so far.
    pattern : (s, k)
        J ψ, real.
    foreign_hz, foreign_decay_per_s, foreign_amplitude, foreign_sd : (f,), (f,), (s, f), (s, f)
        Lines that are no mode.
    model : ModalModel
        The body, with its strikes and sensor as last vertices.
    strike_vertex, strike_direction : (s,), (s, 3)
        Of the strikes.
    sensor_vertex, sensor_direction : int, (3,)
        Of the sensor.
    signal, predicted : (s, n)
        Recordings and the model's, from the onset on; None for lists of features.
    noise : (s,)
        Rms of the recordings' noise, as if it were white.
    floor : Floor
        Its density at the middle strike; None where it is white, or not known.
    sr : int
        Sampling rate in Hz.
    signed : bool
        Whether phases are true.
    push : (s, m) complex
        Amplitude of every mode at the sensor by the model so far, its pulse included.
    pressed : (s, m)
        Fraction of the strike's impulse that each mode takes, by the pulse so far.
    all_hz : (m,)
        Frequencies of the modes.
    plain : ModalModel
        `model` with the mesh's own frequencies.
    strike : tuple of int
        Indices of the strikes in the case.
    source : Any
        What they were recorded from, the host's own.
    elastic : Elastic
        The body under other elasticities, where there is a mesh.
    poisson : Poisson
        Of `plain`, where nothing has moved its modes yet.
    own : (s, n)
        Recordings without other resonators found so far.
    dry : bool
        Whether the lines are those outside the room.
    """

    impulse_n_s: Array
    freq_hz: Array
    decay_per_s: Array
    freq_sd_hz: Array
    decay_sd_per_s: Array
    amplitude: Array
    amplitude_sd: Array
    mode: tuple[Array, ...]
    model_hz: Array
    expected_decay_per_s: Array
    expected: Array
    pattern: Array
    foreign_hz: Array
    foreign_decay_per_s: Array
    foreign_amplitude: Array
    foreign_sd: Array
    model: ModalModel | None
    strike_vertex: Array
    strike_direction: Array
    sensor_vertex: int
    sensor_direction: Array
    signal: Array | None
    predicted: Array | None
    noise: Array
    sr: int
    signed: bool
    push: Array  # (s, m) complex: every mode's amplitude at the sensor under the model so far, its pulse included
    pressed: Array  # (s, m) share of the strike's impulse that each mode takes, under the pulse so far
    all_hz: Array  # (m,) their frequencies
    plain: ModalModel | None  # `model` with the mesh's own frequencies
    strike: tuple[int, ...] = ()
    source: Any = None
    elastic: Elastic | None = None
    poisson: Poisson | None = None
    # (s, n) signal without what the model so far knows to ring beside the body, where there is such
    own: Array | None = None
    dry: bool = False  # whether lines are identified as they would be without the room they were recorded in
    floor: Floor | None = None

    @property
    def residual(self) -> Array:
        """Compute signal − predicted (s, n)."""
        assert self.signal is not None and self.predicted is not None
        return np.asarray(self.signal - self.predicted)

    @property
    def omega(self) -> Array:
        """Compute the undamped angular frequencies (k,) of the lines in rad/s."""
        return np.asarray(np.hypot(2 * np.pi * self.freq_hz, np.nan_to_num(self.decay_per_s)))

    @property
    def level_n_s(self) -> Array:
        """Return the strikes' impulses (s,), 1 where unknown."""
        return np.where(np.isfinite(self.impulse_n_s), self.impulse_n_s, 1.0)

    @property
    def every_hz(self) -> Array:
        """Return the frequencies (k + f,) of all lines: those that are modes, then foreign ones."""
        return np.concatenate([self.freq_hz, self.foreign_hz])

    @property
    def every_decay_per_s(self) -> Array:
        """Return the decays (k + f,) of all lines."""
        return np.concatenate([self.decay_per_s, self.foreign_decay_per_s])

    @property
    def every_amplitude(self) -> Array:
        """Return the amplitudes (s, k + f) of all lines."""
        return np.concatenate([self.amplitude, self.foreign_amplitude], axis=1)

    @property
    def places(self) -> Array:
        """Return the vertices (s + 1,) of the strikes and the sensor."""
        return np.append(self.strike_vertex, self.sensor_vertex)

    def noise_at(self, freq_hz: Array) -> Array:
        """Return the rms (s, k) of white noise as dense as the recordings' is at frequencies (k,).

        A room's noise is up to 30 dB denser at 50 Hz than at 1 kHz.
        """
        noise = np.broadcast_to(self.noise, len(self.impulse_n_s))
        if self.floor is None:
            return np.repeat(noise[:, None], len(freq_hz), axis=1)
        return np.outer(noise / np.median(noise), np.sqrt(self.floor.density(freq_hz, self.sr)))

    def participation(self, shape: Array) -> tuple[Array, Array]:
        """Compute how much of each mode the strikes drive and the sensor observes.

        Parameters
        ----------
        shape : (s + 1, 3, m)
            Mode shapes φ at the strikes and the sensor: ``model.shape[self.places]``.

        Returns
        -------
        into, out : (s, m), (m,)
            J φ(p)·e of the strikes, φ(q)·n of the sensor.
        """
        into = np.einsum("sxm,sx->sm", shape[:-1].astype(float), self.strike_direction) * self.level_n_s[:, None]
        return into, np.einsum("xm,x->m", shape[-1].astype(float), self.sensor_direction)


@dataclass(frozen=True, slots=True, eq=False)
class Evidence:
    """All that an effect may read.

    Attributes
    ----------
    observed : tuple of ObjectEvidence
        The objects' strikes.
    alpha_per_s, beta_s : float
        The material's Rayleigh damping so far.
    gain : float
        The case's gain so far.
    found : tuple of str
        Ids of the effects found so far.
    band_hz : (2,)
        Band of the analysis.
    seed : int
        Of anything random.
    known : Effect
        The effect as found in the whole evidence, or beside other effects: to be fitted again, not to be looked for.
    held_out : bool
        Whether a strike is left out and the numbers of `known` are to be estimated again; axes of degenerate pairs,
        which a linear body does not show, stay those of `known`.
    """

    observed: tuple[ObjectEvidence, ...]
    alpha_per_s: float
    beta_s: float
    gain: float
    found: tuple[str, ...]
    band_hz: tuple[float, float]
    seed: int = 0
    known: Effect | None = None
    held_out: bool = False
