"""Files of the user and of the project: their kinds, TOML and CSV, spelling suggestions, atomic writes.

May import errors and pydantic, and numpy for tables. The meaning of a section or a column does not belong here.
"""
