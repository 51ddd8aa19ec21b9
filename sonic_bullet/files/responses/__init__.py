"""Responses of instruments, from tables and filters."""
