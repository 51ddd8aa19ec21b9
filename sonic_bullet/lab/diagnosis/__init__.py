"""Diagnosis of a fitted model: which physical effects it lacks.

Recordings against the fitted model, candidate effects tried on strikes they were not fitted to, a verdict.

Case -> CaseFit (estimator) -> prediction/: struck bodies under a hypothesis, rendered -> evidence/: what effects read
  -> `propose` of every candidate of `effects` -> selection/: strikes left out and rendered, with and without each
  -> the best is added, and again -> diagnose.py: Diagnosis, with verdict, errors, predictions -> report, preset, WAV
"""

from sonic_bullet.lab.diagnosis.diagnose import Diagnosis, diagnose

__all__ = ["Diagnosis", "diagnose"]
