"""Commands on solids that are no scenes."""
