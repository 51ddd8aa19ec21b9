"""How each effect is looked for: `evidence` is what is read, `searches` who reads it; a file or folder an effect.

Its physics, `apply` and the numbers with their ranges, is in the file of the same name in `sonic_bullet.effects`.
"""
