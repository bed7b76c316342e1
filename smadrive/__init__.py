"""smadrive: a driver that moves a shape-memory-alloy wire to a displacement setpoint.

docs/architecture.md describes the subpackages. This file imports nothing, so that `smadrive off` starts at once.
"""
