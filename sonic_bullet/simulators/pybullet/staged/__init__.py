"""PyBullet with poses that are set, not simulated: to draw pictures, or to find contacts."""
