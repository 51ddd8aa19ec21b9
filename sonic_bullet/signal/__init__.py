"""Signals as such: windows, spectra and their inverse, bands, noise floors, robust fits, distances of sounds.

    elementary       exp, sin, products and eigenvalues of the same bits on every machine
    short_time       windows; a signal, whole or in frames -> spectra, powers
    spectrogram      frames with zeros around a signal, float32 -> transform -> inverse
    peaks            a curve -> its peaks
    octave_bands     powers over frequency -> powers of octaves
    exponential_law  quantiles of noise's powers -> their means
    band_time        levels of a sound by thirds of octaves and time, and their distance
    noise_part       what stands beside lines, by its levels in bands and over time
    log_spectral     stationary noise floors; distance of two sounds where they stand above the noise
    robust           losses, weights and fits that outliers do not decide
    matching         prices of pairs -> one-to-one pairs; cosines of columns

What a strike, a line or a mode is nothing here knows.
"""
