"""Films, scores, stems: one command a file, and outputs of `render` besides the mix."""
