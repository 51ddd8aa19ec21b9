"""Tables that may exceed the memory.

`log_steps` are a contact log's steps as rows, `step_entries` those rows in a file.
"""
