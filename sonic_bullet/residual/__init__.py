"""What the modes do not say: its spectrogram, its transfer to other bodies and strikes, its way back to samples, its
form in a preset.

recorded - represented -> Power (compute) -> Residual (code) -> preset
Residual + the struck body's modes -> transfer -> invert -> grain (grains), frame by frame (player)
"""
