"""Compiled synthesis with explicit state: loads become strikes and friction, forces modal motion, motion pressure.

strikes, pulse: impacts | surface_kernel, profile: rolling and sliding | bank: the modes | path: to the microphone
"""
