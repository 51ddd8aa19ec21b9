"""Collision shapes of links: queried from PyBullet, or found otherwise where a query would end the process."""
