"""Recorded strikes as the residual takes them."""
