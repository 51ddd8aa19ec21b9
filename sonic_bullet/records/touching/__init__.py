"""What touches a surface, and how it moves: responses of sensors, motions of links."""
