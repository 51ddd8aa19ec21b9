"""Diagnosis of a fitted model: which physical effects it lacks.

Recordings against the fitted model, candidate effects tried on strikes they were not fitted to, a verdict.

Case -> CaseFit (estimator) -> Struck bodies (struck_bodies.py) + Hypothesis (hypothesis.py) -> Evidence
    (effect_evidence.py)
  -> every candidate's `propose` -> leave one strike out, render, compare; control effects alike (cross_validation.py)
  -> the best is added, and again -> Diagnosis: verdict, errors, predictions (diagnose.py) -> report, preset, WAV
"""

from sonic_bullet.diagnosis.diagnose import Diagnosis, diagnose

__all__ = ["Diagnosis", "diagnose"]
