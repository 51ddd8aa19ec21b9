"""Files of spatial acoustics (SOFA)."""
