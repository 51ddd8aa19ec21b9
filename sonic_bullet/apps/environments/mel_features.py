"""Log-mel features for audio policies: X = log(max(|STFT|² F, floor)).

Frames of 400 samples at 16 kHz (25 ms), 160 apart (10 ms), a periodic Hann window, the power of each bin, 64 triangular
filters on the HTK mel scale, m = 2595 log10(1 + f/700), from 0 Hz to half the rate, each of peak 1 (norm None): equal
to torchaudio's MelSpectrogram(16000, n_fft=400, hop_length=160, n_mels=64, center=False), and the input of See, Hear,
and Feel (Li et al. 2022). The floor is a limit, so that silence is exactly log(floor) and no value above it is changed.
"""

from __future__ import annotations

from fractions import Fraction
from functools import lru_cache

import numpy as np

from sonic_bullet.files import check_sr
from sonic_bullet.records import Array
from sonic_bullet.records.coerce import as_flag, as_number, as_whole
from sonic_bullet.records.errors import AudioError
from sonic_bullet.signal.short_time import short_time_spectra

MEL_RATE_HZ = 16_000
MEL_N_FFT = 400
MEL_HOP = 160
MEL_BANDS = 64
# least power of a band: |STFT|² of a sine of amplitude a at a bin's middle is (a · MEL_N_FFT / 4)², so 1e-8 Pa there,
# far below hearing (2e-5 Pa)
MEL_FLOOR_PA2 = 1e-12


def log_mel(
    audio: Array,
    sr: int,
    *,
    rate_hz: int = MEL_RATE_HZ,
    mels: int = MEL_BANDS,
    n_fft: int = MEL_N_FFT,
    hop: int = MEL_HOP,
    center: bool = False,
    floor: float = MEL_FLOOR_PA2,
) -> Array:
    """Compute the natural logarithm of the power in mel bands.

    Parameters
    ----------
    audio : Array, shape (channels, n) or (n,)
    sr
        Its rate; it is resampled to rate_hz by scipy.signal.resample_poly, which filters out frequencies above the
        lower half rate.
    center
        Frames are centred on every hop-th sample and the audio is mirrored past its ends, 1 + n//hop of them; else they
        are within it, 1 + (n - n_fft)//hop.
    floor
        The least power.

    Returns
    -------
    Array of float32, shape (channels, mels, frames)

    Raises
    ------
    AudioError
        A rate is not valid, samples are not finite numbers, or audio is shorter than a frame (join the observations of
        several steps).
    """
    from scipy.signal import get_window, resample_poly

    sr, rate_hz = check_sr(sr), check_sr(rate_hz)
    n_fft = as_whole(n_fft, "n_fft", "give samples a frame, 2 or more", least=2, most=2**20, error=AudioError)
    hop = as_whole(hop, "hop", "give samples from frame to frame, 1 or more", least=1, error=AudioError)
    floor = as_number(floor, "floor", "give the least power, above 0", above=0, error=AudioError)
    filters = mel_filters(rate_hz, n_fft, mels)
    samples = _samples(audio)
    ratio = Fraction(rate_hz, sr)
    if ratio != 1:
        samples = resample_poly(samples, ratio.numerator, ratio.denominator, axis=-1)
    short = n_fft // 2 + 1 if as_flag(center, "center") else n_fft
    if samples.shape[-1] < short:
        least = (short - 1) * sr // rate_hz + 1
        raise AudioError(
            f"audio of {np.shape(audio)[-1]} samples is shorter than a frame, {least} samples at {sr} Hz",
            "join the observations of several steps, or take a shorter n_fft",
        )
    if center:
        samples = np.pad(samples, ((0, 0), (n_fft // 2, n_fft // 2)), mode="reflect")
    spectrum = short_time_spectra(samples, get_window("hann", n_fft), hop)
    power = (spectrum.real**2 + spectrum.imag**2) @ filters
    return np.asarray(np.log(np.maximum(power, floor)).swapaxes(-1, -2), np.float32)


@lru_cache(maxsize=8)
def mel_filters(rate_hz: int = MEL_RATE_HZ, n_fft: int = MEL_N_FFT, mels: int = MEL_BANDS) -> Array:
    """Return weights (n_fft//2 + 1, mels) of a power spectrum's bins in the mel bands, read-only.

    Band i rises from 0 at edge i to 1 at edge i+1 and falls to 0 at edge i+2; mels + 2 edges are even in mel from 0 to
    rate_hz / 2. From the first band's peak to the last's the weights of a bin sum to 1.

    Raises
    ------
    AudioError
        An argument is out of range.
    """
    rate_hz = check_sr(rate_hz)
    mels = as_whole(mels, "mels", "give the number of bands, 1 or more", least=1, most=4096, error=AudioError)
    n_fft = as_whole(n_fft, "n_fft", "give samples a frame, 2 or more", least=2, most=2**20, error=AudioError)
    highest_mel = 2595 * np.log10(1 + rate_hz / 2 / 700)
    edge_hz = 700 * (10 ** (np.linspace(0, highest_mel, mels + 2) / 2595) - 1)
    bin_hz = np.linspace(0, rate_hz // 2, n_fft // 2 + 1)[:, None]
    width_hz = np.diff(edge_hz)
    rising, falling = (bin_hz - edge_hz[:-2]) / width_hz[:-1], (edge_hz[2:] - bin_hz) / width_hz[1:]
    weights = np.maximum(0.0, np.minimum(rising, falling))
    weights.setflags(write=False)
    return weights


def _samples(audio: Array) -> Array:
    """Return (channels, n) float64 of finite numbers; raises AudioError."""
    remedy = "give samples in pascals, (channels, n) or (n,)"
    try:
        samples = np.atleast_2d(np.asarray(audio, np.float64))
    except (TypeError, ValueError):
        raise AudioError("audio is no array of numbers", remedy) from None
    if samples.ndim != 2:
        raise AudioError(f"audio has the shape {np.shape(audio)}", remedy)
    if not np.isfinite(samples).all():
        raise AudioError("audio holds samples that are no numbers", remedy)
    return samples
