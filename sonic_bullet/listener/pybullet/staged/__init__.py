"""PyBullet as a stage of poses that are set, not simulated: drawn as pictures, or asked who touches whom."""
