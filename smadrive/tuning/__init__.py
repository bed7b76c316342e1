"""The live tuning page: a session in the control process, which runs the loop, and three child processes that may die.

session/ is the session, front/ answers OFF, page/ shows the run and sends requests, builder/ builds models, link/
connects the processes. This package may import rig and everything below it. Device registers, identification algorithms
and anything that the loop would wait for do not belong here.
"""
