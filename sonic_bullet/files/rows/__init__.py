"""Rows that need not fit into memory: `spool` keeps them while a run goes on, `log_steps` are a contact log's steps as
rows, `step_entries` those rows in a file.
"""
