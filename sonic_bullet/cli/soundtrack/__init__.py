"""Films, scores, stems: one command a file, and what `render` writes besides the mix."""
