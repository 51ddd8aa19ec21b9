"""Who stands on what: contacts that are held, and the poles that bodies have on them."""
