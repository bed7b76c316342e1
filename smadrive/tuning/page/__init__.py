"""The page process: bokeh documents, which show what the loop publishes and send the requests of the user.

It may import bokeh, identification (for fits), hysteresis, `tuning.link` and `stream`. It never accesses a device.
Every request of a user except OFF passes `ClientRegistry`, so that only the client in control can change the session.
"""
