"""TOML texts: parsing with limits on size, frequent mistakes, reading of a text with mistakes.

May import number_text alone of `files`. Paths, sections and their values do not belong here.
"""
