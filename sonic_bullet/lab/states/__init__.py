"""What changed between two states of one real thing: the difference measured, named and predicted.

recorded_states -> octave_values, take_lines -> changes (chance, line_pairs) -> state_causes -> take_prediction
state_series, odd_pieces: of more than two; state_comparison: all of it
"""
