"""What changed between two states of one real thing: the difference measured, named and predicted.

recorded_states -> octave_values, take_lines -> changes (chance, line_pairs) -> causes -> prediction; series, pieces
"""
