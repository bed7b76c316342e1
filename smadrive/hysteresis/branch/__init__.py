"""The exact solution along one branch: tables, stepping, inverse, certificates. Each direction of v has its own law.

May import numerics, errors, numpy and scipy, and from hysteresis `model.py` and `certificate.py`. The laws themselves
do not belong here.
"""
