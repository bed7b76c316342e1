"""The plots of a page, the samples of the whole session, and the window of time that a page shows.

This package may import what page/ may import, except page.py. It sends no request, so a look at earlier samples does
not affect the run.
"""
