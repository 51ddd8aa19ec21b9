"""Options of every task, each said once: name, default, unit, range and help.

record (a frozen dataclass with `option` fields) -> keywords of a Python function (`takes`)
                                                 -> options of a command, its --help and its page (`apps.cli.commands`)

The file is named for the task: `render` has what film, score and play share with it. Nothing here imports anything that
computes, so that a help text is quick.
"""
