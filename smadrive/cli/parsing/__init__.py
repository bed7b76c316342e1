"""From the typed words to a command: the list of commands, their shared options, their usage and their values.

It may import errors, files and typer. `app.py` imports the module of the typed command, and no other one.
"""
