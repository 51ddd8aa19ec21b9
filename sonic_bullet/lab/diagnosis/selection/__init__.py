"""Selection of effects: stepwise and pairwise, by cross-validation with control effects, phases and decays."""
