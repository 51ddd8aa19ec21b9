"""Changes of a body's modes: frequencies in cents, decays in per cent, shapes by modal assurance.

cents = 1200 log2(f_B/f_A)        MAC = (φ_Aᵀφ_B)² / (φ_Aᵀφ_A · φ_Bᵀφ_B) [Allemang and Brown 1982]
"""

from __future__ import annotations

import numpy as np

from sonic_bullet.apps.compare.comparison_record import Consequence
from sonic_bullet.apps.compare.inputs.log_differences import same_model
from sonic_bullet.files.contact_log import ContactLog
from sonic_bullet.records import ModalModel
from sonic_bullet.records.counts import format_count


def modal_effects(a: ContactLog, b: ContactLog, pairs: list[tuple[int | None, int | None]]) -> list[Consequence]:
    """Return one effect for each body whose modes differ."""
    found = []
    for i, j in pairs:
        if i is not None and j is not None and not same_model(a.bodies[i], b.bodies[j]):
            one, other = a.bodies[i].model, b.bodies[j].model
            if one is not None and other is not None and one.mode_count and other.mode_count:
                found.append(_describe_change(a.bodies[i].name, one, other))
    return found


def _describe_change(name: str, a: ModalModel, b: ModalModel) -> Consequence:
    assured = 32  # number of modes whose shapes are compared
    n = min(a.mode_count, b.mode_count)
    cents = 1200 * np.log2(b.freq_hz[:n] / a.freq_hz[:n])
    with np.errstate(divide="ignore", invalid="ignore"):
        decay = (b.decay_per_s[:n] / a.decay_per_s[:n] - 1) * 100
    decay = decay[np.isfinite(decay)]
    words = [f"frequencies {_describe_spread(cents, 'cents')}"] if np.abs(cents).max() > 1e-6 else []
    values = {"cents": round(float(np.median(cents)), 4), "modes_a": a.mode_count, "modes_b": b.mode_count}
    if len(decay) and np.abs(decay).max() > 1e-6:
        words.append(f"decays {_describe_spread(decay, '%')}")
        values["decay_percent"] = round(float(np.median(decay)), 4)
    if a.mode_count != b.mode_count:
        words.append(f"{a.mode_count} → {format_count(b.mode_count, 'mode')}")
    if np.array_equal(a.vertex_m, b.vertex_m):
        k = min(n, assured)
        x, y = (model.shape[:, :, :k].reshape(-1, k).astype(float) for model in (a, b))
        mac = (x * y).sum(axis=0) ** 2 / ((x * x).sum(axis=0) * (y * y).sum(axis=0))
        values["mac_least"] = round(float(mac.min()), 4)
        if mac.min() < 0.99:
            words.append(f"shapes turn or trade places (modal assurance {mac.min():.2f} at least)")
    else:
        words.append(f"surface of {len(a.vertex_m)} → {len(b.vertex_m)} vertices")
    return Consequence("modes", f"{name}: {', '.join(words) or 'modes change in their last bits'}", None, values)


def _describe_spread(values: np.ndarray[tuple[int], np.dtype[np.float64]], unit: str) -> str:
    low, high = float(values.min()), float(values.max())
    middle = f"{float(np.median(values)):+.3g} {unit}"
    return middle if high - low < 0.05 * max(abs(low), abs(high)) else f"{middle} ({low:+.3g} … {high:+.3g})"
