"""Which effects are accepted: stepwise and pairwise selection, cross-validation against control effects, tests by phase
and decay.
"""
