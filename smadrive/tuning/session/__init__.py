"""The tuning session, in the process of the control loop: it serves the page's requests between two ticks.

May import rig, control and the rest of tuning except page/ and front/. Nothing here may wait, or build a model.
"""
