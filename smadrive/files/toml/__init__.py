"""TOML texts: parsing with limits on size, frequent mistakes, reading of a text with mistakes.

Of the modules of `files` it may import only number_text. Paths, sections and their values do not belong here.
"""
