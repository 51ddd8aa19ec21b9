"""What the recordings say beside a hypothesis: baseline, refit, unmatched modes, degenerate pairs, modes that go with
their level.
"""
