"""smadrive: a driver that moves a shape-memory-alloy wire to the displacement that is set.

Subpackages hold the code; see docs/ for their map. This file imports nothing, so that `smadrive off` starts at once.
"""
