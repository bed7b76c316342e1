"""Memory of turning points: the Preisach plane, the stack of turning points, and T-S fuzzy rules with this memory.

May import numerics, files, errors, numpy and scipy, and the rest of hysteresis. Identification does not belong here.
"""
