"""Roads that a user walks, by the command line, each in a folder of its own."""
