"""The model builder process: it changes and checks models and builds controllers, so that the loop does not.

May import control, hysteresis, rig, `tuning.tuning` and `tuning.link`; never the session, the pages or a device.
"""
