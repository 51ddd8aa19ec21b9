"""Evidence of the recordings against a hypothesis.

Baseline, refit, unmatched modes, degenerate pairs, modes that depend on their level.
"""
