"""The pages (HTML) that commands write: reports of logs, fits, comparisons, the demo and the paper.

May import runs and everything below it, and the other views. Metrics are computed in runs, never here.
"""
