"""What links collide as: asked of PyBullet, or found otherwise where asking would end the process."""
