"""The plots of the page, the samples of the whole session, and the window of time that a page looks at.

It may import what the page may import, except the page itself. It sends no request: looking back changes nothing in the
run.
"""
