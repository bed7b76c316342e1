"""Reads the command line: the list of commands, their shared options, their help, and the values of options.

It may import errors, files and typer. `app.py` imports the module of the typed command, and of no other command.
"""
