"""sonic_bullet: PyBullet scenes that sound."""
