"""Commands on solids that are not scenes."""
