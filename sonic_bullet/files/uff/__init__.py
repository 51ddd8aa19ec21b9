"""Universal files of experimental modal analysis, read and written by pyuff: `pip install "sonic_bullet[uff]"`."""
