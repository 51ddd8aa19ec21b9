"""contact -> bank -> path: forces, modes in motion, pressure; the run time that drives them."""
