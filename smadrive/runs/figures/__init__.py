"""The figures of a log and of a fit, as reports and notebooks show them.

May import runs and everything below it. Pages and tables do not belong here.
"""
