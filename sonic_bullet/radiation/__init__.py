"""How a body's modes radiate: what each is heard as at 1 m, and what that costs it.

ModalModel + Air -> entrained_mass (near field) -> far_field -> pressure weight, radiation damping
    -> radiated: the same, kept
"""
