"""Log-mel features against closed forms, and against other libraries where they are installed."""

from __future__ import annotations

import numpy as np
import pytest

from sonic_bullet.apps.environments import log_mel, mel_filters
from sonic_bullet.apps.environments.mel_features import MEL_BANDS, MEL_FLOOR_PA2, MEL_HOP, MEL_N_FFT, MEL_RATE_HZ
from sonic_bullet.records.errors import AudioError


def band_edges_hz() -> np.ndarray:
    """m = 2595 log10(1 + f/700), evenly from 0 to 8 kHz."""
    mel = np.linspace(0, 2595 * np.log10(1 + MEL_RATE_HZ / 2 / 700), MEL_BANDS + 2)
    return 700 * (10 ** (mel / 2595) - 1)


def tone(hz: float, seconds: float = 0.5, sr: int = MEL_RATE_HZ, amplitude: float = 1.0) -> np.ndarray:
    return amplitude * np.sin(2 * np.pi * hz * np.arange(round(seconds * sr)) / sr)


def noise(seconds: float = 0.3, sr: int = MEL_RATE_HZ) -> np.ndarray:
    return np.random.default_rng(0).standard_normal((2, round(seconds * sr)))


@pytest.mark.parametrize("sr", [16_000, 44_100, 48_000])
@pytest.mark.parametrize("band", [10, 20, 40, 55, 62])
def test_a_tone_is_loudest_in_its_band(sr: int, band: int) -> None:
    """Above band 8 a band is wider than a bin of 40 Hz."""
    features = log_mel(tone(band_edges_hz()[band + 1], sr=sr), sr)
    middle = features[0, :, features.shape[2] // 2]
    assert middle.argmax() == band
    far = np.abs(np.arange(MEL_BANDS) - band) > 8
    assert middle[far].max() < middle[band] - np.log(1e4)


def test_a_tone_on_a_bin_has_the_power_of_its_amplitude() -> None:
    """A Hann window spreads a sine of amplitude a over three bins: (a N/4)² in its own, a quarter beside it."""
    bin_hz, amplitude = MEL_RATE_HZ / MEL_N_FFT, 0.02
    line = (amplitude * MEL_N_FFT / 4) ** 2
    expected = np.array([0.25, 1.0, 0.25]) @ mel_filters()[49:52] * line
    power = np.exp(log_mel(tone(50 * bin_hz, amplitude=amplitude), MEL_RATE_HZ)[0].astype(float))
    reached = expected > line / 100
    assert reached.sum() >= 1
    np.testing.assert_allclose(power[reached], np.tile(expected[reached, None], power.shape[1]), rtol=1e-5)


def test_bands_share_what_a_frame_holds() -> None:
    """Weights sum to 1 from the first band's peak to the last's, so that by Parseval all bands together hold
    the energy of the windowed frame there.
    """
    edges, bins = band_edges_hz(), np.arange(MEL_N_FFT // 2 + 1) * MEL_RATE_HZ / MEL_N_FFT
    inside = (bins >= edges[1]) & (bins <= edges[-2])
    np.testing.assert_allclose(mel_filters().sum(axis=1)[inside], 1, atol=1e-12)
    low, high = np.flatnonzero(inside)[[0, -1]]
    samples = np.random.default_rng(1).standard_normal(2000)
    spectrum = np.fft.rfft(samples)
    hz = np.arange(len(spectrum)) * MEL_RATE_HZ / 2000
    spectrum[(hz < bins[low + 3]) | (hz > bins[high - 3])] = 0  # the window leaks over two bins, and less beyond
    samples = np.fft.irfft(spectrum)
    power = np.exp(log_mel(samples, MEL_RATE_HZ)[0].astype(float)).sum(axis=0)
    window = 0.5 - 0.5 * np.cos(2 * np.pi * np.arange(MEL_N_FFT) / MEL_N_FFT)
    for frame, total in enumerate(power):
        piece = window * samples[frame * MEL_HOP : frame * MEL_HOP + MEL_N_FFT]
        np.testing.assert_allclose(total, MEL_N_FFT / 2 * np.sum(piece**2), rtol=1e-3)


def test_frames_lie_within_the_audio_or_are_centred() -> None:
    audio = noise(0.04)
    assert audio.shape == (2, 640)
    inside, centred = log_mel(audio, MEL_RATE_HZ), log_mel(audio, MEL_RATE_HZ, center=True)
    assert inside.shape == (2, MEL_BANDS, 1 + (640 - MEL_N_FFT) // MEL_HOP) == (2, MEL_BANDS, 2)
    assert centred.shape == (2, MEL_BANDS, 1 + 640 // MEL_HOP)
    assert inside.dtype == centred.dtype == np.float32
    mirrored = np.concatenate([audio[:, 200:0:-1], audio, audio[:, -2:-202:-1]], axis=1)
    np.testing.assert_array_equal(centred, log_mel(mirrored, MEL_RATE_HZ))


def test_silence_is_the_floor_and_loudness_a_shift() -> None:
    assert (log_mel(np.zeros((1, 1920)), 48_000) == np.float32(np.log(MEL_FLOOR_PA2))).all()
    quiet, loud = log_mel(noise(), MEL_RATE_HZ), log_mel(10 * noise(), MEL_RATE_HZ)
    np.testing.assert_allclose(loud - quiet, np.log(100), atol=1e-5)


def test_what_an_observation_holds_goes_in() -> None:
    """40 ms at 48 kHz, float32, are two frames."""
    features = log_mel(np.ones((1, 1920), np.float32), 48_000)
    assert features.shape == (1, 64, 2) and np.isfinite(features).all()


@pytest.mark.parametrize(
    ("audio", "how", "text"),
    [
        (np.zeros((1, 1197)), {}, "1197 samples is shorter than a frame, 1198 samples at 48000 Hz"),
        (np.zeros((1, 100)), {"center": True}, "shorter than a frame"),
        (np.full((1, 4800), np.nan), {}, "no numbers"),
        (np.zeros((1, 1, 4800)), {}, "shape"),
        ("sound", {}, "no array"),
        (np.zeros((1, 4800)), {"mels": 0}, "mels is 0"),
        (np.zeros((1, 4800)), {"hop": 0}, "hop is 0"),
        (np.zeros((1, 4800)), {"floor": 0.0}, "floor is 0"),
        (np.zeros((1, 4800)), {"rate_hz": 10}, "sample rate"),
    ],
)
def test_bad_input_is_one_line(audio: object, how: dict[str, object], text: str) -> None:
    with pytest.raises(AudioError, match=text):
        log_mel(audio, 48_000, **how)  # type: ignore[arg-type]


@pytest.mark.parametrize("center", [False, True])
def test_librosa_gives_the_same(center: bool) -> None:
    librosa = pytest.importorskip("librosa")
    power = librosa.feature.melspectrogram(
        y=noise(),
        sr=MEL_RATE_HZ,
        n_fft=MEL_N_FFT,
        hop_length=MEL_HOP,
        n_mels=MEL_BANDS,
        center=center,
        pad_mode="reflect",
        htk=True,
        norm=None,
    )
    np.testing.assert_allclose(log_mel(noise(), MEL_RATE_HZ, center=center), np.log(power), atol=1e-4)


@pytest.mark.parametrize("center", [False, True])
def test_torchaudio_gives_the_same(center: bool) -> None:
    torch, torchaudio = pytest.importorskip("torch"), pytest.importorskip("torchaudio")
    mel = torchaudio.transforms.MelSpectrogram(
        MEL_RATE_HZ, n_fft=MEL_N_FFT, hop_length=MEL_HOP, n_mels=MEL_BANDS, center=center
    )
    power = mel(torch.from_numpy(noise().astype(np.float32))).numpy()
    np.testing.assert_allclose(log_mel(noise(), MEL_RATE_HZ, center=center), np.log(power), atol=1e-3)
