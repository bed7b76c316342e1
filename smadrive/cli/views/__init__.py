"""What the commands show: pages (HTML) of logs and fits, and live text on a terminal.

It may import runs and everything below it. Metrics are computed in runs, never here.
"""
