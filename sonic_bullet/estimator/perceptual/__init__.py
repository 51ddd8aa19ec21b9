"""How alike two sounds are to an ear [Ren, Yeh, Lin 2013, section 4.3]: loudness, images of loudness over time, match
ratios.
"""
