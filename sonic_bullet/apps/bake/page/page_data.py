"""BakedModel -> what a page holds of it: numbers as base64 of little-endian arrays, and one clip of its residual.

JavaScript reads them in geometry.js (`decodeBody`), under the same names.
"""

from __future__ import annotations

from pathlib import Path
from typing import Any

import numpy as np

from sonic_bullet.apps.bake.baked_model import BakedModel
from sonic_bullet.apps.bake.page.variants import PAGE_MATERIALS, MaterialVariant, material_variants
from sonic_bullet.apps.bake.strike_playback import (
    TAP_IMPULSE_N_S,
    choose_strike,
    point_normals,
    pressure_of,
    render_strike,
    shape_at,
)
from sonic_bullet.apps.report.page.assembly import encode_array
from sonic_bullet.engine.residual.offline import residual_sound
from sonic_bullet.files.loudness.meter import k_weighting
from sonic_bullet.files.recordings import read_audio
from sonic_bullet.records import Air, Array

PAGE_FORMAT = "sonic-bullet-page/1"
HEARD_S = 0.5
"""Over which strikes and recordings are of one loudness: an attack, and what rings on of it."""


def page_data(bodies: list[dict[str, Any]], recordings: list[dict[str, Any]]) -> dict[str, Any]:
    """Collect what a page gets."""
    return {
        "format": PAGE_FORMAT,
        "bodies": bodies,
        "recordings": recordings,
        "heard_s": HEARD_S,
        "k_weighting": k_weighting(48_000).tolist(),
    }


def recording_data(path: str) -> dict[str, Any]:
    """Collect a recording's first channel from its onset on. Raises FileError."""
    longest_s, before_s = 5.0, 0.005
    from sonic_bullet.lab.fit.recorded import onset_sample

    sound, sr = read_audio(path)
    start = max(0, onset_sample(sound[0], sr) - round(before_s * sr))
    return {"name": Path(path).name, **clip_data(sound[0, start : start + round(longest_s * sr)], sr)}


def clip_data(samples: Array, sr: int, full_scale: float | None = None) -> dict[str, Any]:
    """Collect a sound as 16 bits of its own peak, and its K-weighted energy; full_scale None: it has no unit."""
    from scipy.signal import sosfilt

    peak = float(np.abs(samples).max(initial=0.0)) or 1.0
    scale = 1.0 if full_scale is None else full_scale
    heard = sosfilt(k_weighting(sr), samples[: round(HEARD_S * sr)] / peak * scale)
    return {
        "sr": sr,
        "samples": encode_array(np.round(samples / peak * 32767), "i2"),
        "full_scale_pa": scale,
        "energy": float(heard @ heard) / sr,
    }


def body_data(
    model: BakedModel, materials: tuple[str, ...] = PAGE_MATERIALS, coarse: BakedModel | None = None
) -> dict[str, Any]:
    """Collect a body's numbers; coarse: as of `material_variants`.

    Raises
    ------
    ModalError
        Where nothing says how the model radiates.
    """
    variants = material_variants(model, materials, coarse=coarse)
    air = Air()
    baked = model.material
    strike = choose_strike(model)
    step = np.abs(model.shape).max(axis=(0, 1)).astype(float) / 32767 + 1e-300  # 1/√kg: -96 dB of the largest
    peak = float(np.abs(render_strike(model, strike, seconds=0.05)).max())
    return {
        "name": model.name,
        "mode_count": model.mode_count,
        "point_count": len(model.point_m),
        "point_m": encode_array(model.point_m, "f4"),
        "normal": encode_array(point_normals(model), "f4"),
        "face": encode_array(model.face, "u4"),
        "shape": encode_array(np.round(model.shape.transpose(2, 0, 1) / step[:, None, None]), "i2"),
        "shape_step": encode_array(step, "f8"),
        "mass_kg": None if model.mass is None else model.mass.mass_kg,
        "freq_hz": encode_array(model.freq_hz, "f8"),
        "decay_per_s": encode_array(model.decay_per_s, "f8"),
        "materials": [variant_data(one) for one in variants],
        "air_impedance": air.density_kg_m3 * air.sound_speed_m_s,
        "radiating_share": 1.0,
        "roughness_m": baked.roughness_m if baked.roughness_m is not None else 1e-6,
        "hurst": baked.hurst if baked.hurst is not None else 0.7,
        "tap": {"point": nearest_point(model, strike.point_m), "impulse_n_s": TAP_IMPULSE_N_S, "peak_pa": peak},
        "residual": residual_clip(model),
        "notes": list(model.notes),
    }


def variant_data(variant: MaterialVariant) -> dict[str, Any]:
    """Collect a variant's numbers."""
    return {
        "name": variant.name,
        "freq0_hz": encode_array(variant.freq0_hz, "f8"),
        "steady_per_s": variant.steady_per_s,
        "own_per_s": encode_array(variant.own_per_s, "f8"),
        "pressure_re": encode_array(variant.pressure_pa_m.real, "f8"),
        "pressure_im": encode_array(variant.pressure_pa_m.imag, "f8"),
        "shape_factor": variant.shape_factor,
        "contact_modulus_pa": variant.contact_modulus_pa if np.isfinite(variant.contact_modulus_pa) else None,
    }


def nearest_point(model: BakedModel, place_m: Array) -> int:
    """Return the number of the point nearest to a place."""
    return int(np.argmin(np.linalg.norm(model.point_m - place_m, axis=1)))


def residual_clip(model: BakedModel) -> dict[str, Any] | None:
    """Synthesise the residual of one tap, as the run time plays it: samples over ``full_scale_pa``, 16 bits.

    ``modal_level_pa`` is √Σ|a|² of the modes so struck, by which a page scales it to other strikes.
    """
    clip_s, sr, quiet = 0.7, 48_000, 10 ** (-60 / 20)
    if model.residual is None:
        return None

    strike = choose_strike(model)
    below = model.freq_hz < sr / 2
    x = 2 * model.freq_hz * strike.contact_s  # the pulse's spectrum: cos(πx/2)/(1 − x²)
    spectrum = np.where(np.abs(1 - x**2) < 1e-6, np.pi / 4, np.cos(np.pi * x / 2) / np.where(x == 1, 1, 1 - x**2))
    amplitude = (pressure_of(model) * (strike.impulse_n_s @ shape_at(model, strike.point_m)) * spectrum)[below]
    clip = residual_sound(
        model.residual, model.freq_hz[below], model.decay_per_s[below], amplitude, round(clip_s * sr), sr
    )
    peak = float(np.abs(clip).max())
    if peak <= 0:
        return None
    loud = np.flatnonzero(np.abs(clip) > quiet * peak)
    clip = clip[: loud[-1] + 1]
    return {
        **clip_data(clip, sr, peak),
        "modal_level_pa": float(np.sqrt((np.abs(amplitude) ** 2).sum())),
        "contact_s": strike.contact_s,
        "source": model.residual.source,
    }
