"""Synthetic recordings that no parameters fit exactly: a plate of each preset, against a model that knows it roughly.

A plate 36 × 26 × 1.2 cm struck off its middle sounds with the preset's E, ρ, ν, α, β, every mode's decay off Rayleigh's
law by 10 % (one sigma), white noise 60 dB under the peak. The model's Poisson's ratio is 0.05 off, its mesh coarser.
"""

from __future__ import annotations

import dataclasses

import numpy as np

from sonic_bullet.files.presets import load_material
from sonic_bullet.lab.lines.line_values import Features
from sonic_bullet.modal import analyse
from sonic_bullet.records import Array, Material, Shape
from studies.ren2013.problem import Problem, modes_of

SR = 48000
ONSET_S = 0.1
PEAK_OVER_NOISE_DB = 60.0


def struck(what: Material, *, edge_m: float | None, count: int) -> tuple[Array, Array]:
    """λ̂ at γ = 1 and the signed amplitudes (m,) of the plate struck off its middle."""
    model = analyse(
        (Shape("box", np.array([0.36, 0.26, 0.012])),),
        dataclasses.replace(what, alpha_per_s=0.0, beta_s=0.0),
        count=count,
        edge_m=edge_m,
    )
    vertex = np.argmin(((model.vertex_m - np.array([0.11, 0.07, 0.006])) ** 2).sum(1))
    return (2 * np.pi * model.freq_hz) ** 2 * what.density_kg_m3 / what.youngs_pa, model.shape[vertex, 2].astype(float)


def plate(name: str, seed: int = 0) -> tuple[Problem, Array]:
    """A recording of the plate made of a preset, against a model that knows it roughly; and the true α, β, γ, σ."""
    rng = np.random.default_rng(seed)
    what = load_material(name)
    gamma = what.youngs_pa / what.density_kg_m3
    lambda_true, amplitude_true = struck(what, edge_m=None, count=60)
    rough = Material.isotropic(
        name, youngs_pa=what.youngs_pa, poisson=what.poisson + 0.05, density_kg_m3=what.density_kg_m3
    )
    lambda_hat, amplitude_hat = struck(rough, edge_m=0.02, count=60)
    alpha, beta = what.alpha_per_s or 0.0, what.beta_s or 0.0
    sigma = 0.1 / np.abs(amplitude_true).max()
    truth = np.array([alpha, beta, gamma, sigma])
    freq_hz, decay, amplitude = modes_of(truth, lambda_true, amplitude_true)
    decay = decay * np.exp(0.1 * rng.standard_normal(len(decay)))
    there = (freq_hz > 20) & (freq_hz < 0.45 * SR)
    freq_hz, decay, amplitude = freq_hz[there], decay[there], amplitude[there]
    time_s = np.arange(int(1.2 * SR)) / SR
    signal = sum(
        a * np.exp(-d * time_s) * np.sin(2 * np.pi * f * time_s)
        for f, d, a in zip(freq_hz, decay, amplitude, strict=True)
    )
    signal = np.concatenate([np.zeros(int(ONSET_S * SR)), signal])
    noise = np.abs(signal).max() * 10 ** (-PEAK_OVER_NOISE_DB / 20)
    signal = signal + noise * rng.standard_normal(len(signal))
    # what an efficient estimator finds: the modes above the noise, off by the Cramér-Rao bound
    spread = np.sqrt(8 * decay**3 / (SR * amplitude**2 / (2 * noise**2)))
    size_spread = np.abs(amplitude) * spread / decay
    observed = amplitude**2 * SR / (4 * decay * noise**2) > 64
    freq_sd, decay_sd, size_sd = spread[observed] / (2 * np.pi), spread[observed], size_spread[observed]
    features = Features(
        freq_hz=freq_hz[observed] + freq_sd * rng.standard_normal(observed.sum()),
        decay_per_s=np.abs(decay[observed] + decay_sd * rng.standard_normal(observed.sum())),
        amplitude=np.abs(np.abs(amplitude[observed]) + size_sd * rng.standard_normal(observed.sum())),
        phase_rad=np.where(amplitude[observed] < 0, np.pi, 0.0),
        freq_sd_hz=freq_sd,
        decay_sd_per_s=decay_sd,
        amplitude_sd=size_sd,
        onset_s=ONSET_S,
        noise_dbfs=float(20 * np.log10(noise)),
        sr=SR,
    )
    return Problem(features, signal, lambda_hat, amplitude_hat), truth
