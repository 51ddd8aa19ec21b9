"""Thin walls held against CalculiX's bricks: see README.md beside this file."""
