"""Signals as such: short-time spectra and their inverse, octave bands, noise floors, distances of sounds.

    short_time     Hann windows inside a signal -> spectra, powers
    spectrogram    frames with zeros around a signal, float32 -> transform -> inverse
    octave_bands   powers over frequency -> powers of octaves
    log_spectral   stationary noise floors; distance of two sounds where they stand above the noise

What a strike, a line or a mode is nothing here knows.
"""
