"""The fit of the resistance as a function of temperature and phase, and its least-squares problem.

May import what identification may import. The identified resistance itself belongs to wire.
"""
