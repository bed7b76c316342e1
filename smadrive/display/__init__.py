"""Small HTML for notebooks: a card of facts, and a line plot as inline SVG.

Imports the standard library alone, so that every object may have a card. Figures of reports belong to runs.
"""
