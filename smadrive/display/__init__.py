"""Small HTML for notebooks: a card of facts, and a line plot as inline SVG.

Imports only the standard library, so that every package can use it. Figures of reports belong to runs.
"""
