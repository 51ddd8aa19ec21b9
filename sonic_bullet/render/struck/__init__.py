"""What strikes of one physics step have to do with each other."""
