"""Commands that run or replay a scene: `render`, `play`, `doctor`, and what `film` shares with them."""
