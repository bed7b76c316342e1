"""Files of the user and of the project: their kinds, TOML and CSV, spelling suggestions, complete writes.

It imports the errors and pydantic, and numpy for tables alone. The meaning of a section or a column never belongs here.
"""
