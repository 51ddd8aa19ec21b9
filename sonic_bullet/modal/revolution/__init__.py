"""Bodies of revolution: found by rings.py, cut by section.py, solved by series.py (Fourier series), shown in skin."""
