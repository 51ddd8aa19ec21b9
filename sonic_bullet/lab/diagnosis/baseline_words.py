"""The baseline of a diagnosis in words: the fitted material, before an effect is added."""

from __future__ import annotations

import numpy as np

from sonic_bullet.lab.diagnosis.diagnose import Diagnosis


def describe_baseline(d: Diagnosis) -> str:
    """Format the baseline's numbers; "not fitted" of those that have no part in it, or are the guess's."""
    base, fit, identified = d.closed.before, d.found.fit, np.isfinite(np.diag(d.found.fit.covariance))
    damped = any(body.own_decay_per_s is None and body.recorded is not None for body in d.bodies)
    shaped = any(body.family is not None and body.recorded is not None for body in d.bodies)
    numbers = (
        ("α", f"{base.alpha_per_s:.4g} 1/s", damped and identified[0]),
        ("β", f"{base.beta_s:.4g} s", damped and identified[1]),
        ("E/ρ", f"{fit.gamma_m2_s2:.5g} m²/s²", shaped and identified[2]),
        ("ν", f"{fit.poisson_ratio:.3f}", shaped and identified[4]),
    )
    return ", ".join(f"{name} = {text}" if fitted else f"{name} not fitted" for name, text, fitted in numbers)
