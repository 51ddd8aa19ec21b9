"""Jointed bodies: how their links move together."""
