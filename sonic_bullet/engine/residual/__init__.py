"""Residual of the modes: its spectrogram, transfer to other bodies and strikes, inversion to samples, form in a preset.

recorded - represented -> Power (compute) -> Residual (code) -> preset
Residual + the struck body's modes -> transfer -> invert -> grain (grains), frame by frame (player)
"""
