"""Sparse matrices of elements: the order of unknowns, and the factor in that order."""
