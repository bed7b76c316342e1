"""The live tuning page: the session in the loop's process (session/), and three processes beside it that may die:
front/ answers OFF, page/ shows and asks, builder/ builds models; link/ connects them. May import rig and all below it.
Device registers, identification algorithms and anything that the loop would wait for do not belong here.
"""
