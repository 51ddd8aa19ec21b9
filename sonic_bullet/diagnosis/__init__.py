"""What does the model lack? Recordings against the fitted model, suspects tried on strikes they were not fitted on, a verdict.

Case -> CaseFit (estimator) -> Struck bodies (bodies.py) + Hypothesis (play.py) -> Evidence (evidence.py)
  -> every suspect's `propose` -> trial: leave one strike out, render, compare; null effects alike (trial.py)
  -> the best is added, and again -> Diagnosis: verdict, errors, predictions (diagnose.py) -> report, preset, WAV
"""

from sonic_bullet.diagnosis.diagnose import Diagnosis, diagnose

__all__ = ["Diagnosis", "diagnose"]
