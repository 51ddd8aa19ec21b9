"""Platform: progress, supervised processes, results kept as long as what they are of."""
