"""How objects show themselves: in a notebook as a card of facts and a line plot (inline SVG), elsewhere as ASCII text.

Imports only the standard library, so that every package can use it. Figures of reports belong to runs.
"""
