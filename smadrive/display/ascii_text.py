"""Texts in ASCII: the repr of a public object can be printed to every output, also where there is no "°"."""

from __future__ import annotations

SUBSTITUTES = {
    "°": "deg ",
    "µ": "u",
    "μ": "u",
    "Ω": "Ohm",
    "±": "+/-",
    "·": "*",
    "×": "x",
    "≤": "<=",
    "≥": ">=",
    "→": "->",
    "–": "-",
    "—": "-",
    "−": "-",
    "…": "...",
    "━": "-",
    "─": "-",
    "│": "|",
    **dict.fromkeys("▁▂▃", "."),
    **dict.fromkeys("▄▅▆", ":"),
    **dict.fromkeys("▇█", "#"),
    "’": "'",
    "“": '"',
    "”": '"',
}
"""The spelling in ASCII of characters that smadrive prints; any other character is escaped."""


def ascii_text(text: str) -> str:
    """Return the text with substitutes for the characters that ASCII lacks; other characters are escaped."""
    return text.translate(_TABLE).encode("ascii", "backslashreplace").decode("ascii")


_TABLE = str.maketrans(SUBSTITUTES)
