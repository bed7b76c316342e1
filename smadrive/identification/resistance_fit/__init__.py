"""The fit of the resistance over temperature and displacement, and the columns of its least-squares problem.

May import what identification may import. The identified resistance itself belongs to wire.
"""
