"""Docstrings list fields in aligned columns. Markdown would join such lines, so they become blocks of code."""

import re

import griffe

ROW = re.compile(r"\S.*?\s{2,}\S")


class DocstringTables(griffe.Extension):
    """Indent every paragraph whose lines are rows of two columns, or continue such a row."""

    def on_object(self, *, obj, **_kwargs):
        if obj.docstring is not None:
            paragraphs = obj.docstring.value.split("\n\n")
            obj.docstring.value = "\n\n".join(_as_code(one) if _is_table(one) else one for one in paragraphs)


def _is_table(paragraph):
    lines = paragraph.split("\n")
    return bool(ROW.match(lines[0])) and all(ROW.match(line) or line.startswith("  ") for line in lines)


def _as_code(paragraph):
    return "\n".join(f"    {line}" for line in paragraph.split("\n"))
