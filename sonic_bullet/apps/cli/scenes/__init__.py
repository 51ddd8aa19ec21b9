"""Commands that run or replay a scene: `render`, `play`, `doctor`, and code that `film` shares with them."""
