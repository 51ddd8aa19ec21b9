"""Bodies of revolution: recognised (rings.py), cut (section.py), solved by a Fourier series (series.py), shown
(skin.py).
"""
