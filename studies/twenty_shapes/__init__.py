"""Twenty shapes of workshop and table against CalculiX: is the error that a model tells the true one?"""
