"""Tables that may exceed the memory.

`spool` holds them during a run, `log_steps` are a contact log's steps as rows, `step_entries` those rows in a file.
"""
