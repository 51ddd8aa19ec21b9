"""Twenty shapes of workshop and table against CalculiX: is the error that a model states the true one?"""
