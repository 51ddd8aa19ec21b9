"""Uses of the instrument and the laboratory: none knows another but the command line."""
