"""Standard output and standard error of the commands: results for a person or a program, tables, failed writes.

It may import errors, display, typer and rich. It must import little at its start, because `off` needs it at once.
"""
