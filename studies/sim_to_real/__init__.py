"""Learned in simulation, tested on recordings: see __main__."""
