"""The model builder process: it changes and checks models, and builds controllers.

The loop does not do this work itself, because the work would delay the ticks. This package may import control,
hysteresis, rig, `tuning.tuning`, `tuning.link` and `stream`; never the session, the pages or a device.
"""
