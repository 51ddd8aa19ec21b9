"""Channels of a run: which faces mirror its bodies, weights by direction, and what is added behind the driver."""
