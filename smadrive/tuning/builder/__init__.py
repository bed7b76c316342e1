"""The model builder process: it changes and checks models, and builds controllers. In the loop this would
delay the ticks.

It may import control, hysteresis, rig, `tuning.tuning` and `tuning.link`; never the session, the pages or a device.
"""
