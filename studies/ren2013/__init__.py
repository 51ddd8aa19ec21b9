"""The procedure that the project started from, kept as a yardstick.

recording -> features by greedy search -> starts -> each walked down the hybrid metric -> α, β, γ, σ
    [Ren, Yeh, Lin 2013, sections 4 and 5]
"""
