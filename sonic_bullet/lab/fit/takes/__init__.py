"""Takes held against what is fitted: at which gain, whether they are impacts, beside a guess, what to record next."""
