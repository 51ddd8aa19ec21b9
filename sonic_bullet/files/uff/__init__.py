"""Universal files of experimental modal analysis, in and out, by pyuff: `pip install "sonic_bullet[uff]"`."""
