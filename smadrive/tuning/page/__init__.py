"""The page process: bokeh documents, which show what the loop publishes and send the requests of the user.

It may import bokeh, `tuning.link`, `stream`, the maths, and what it shows of the rig file, the loop and the shutdown.
It never accesses a device. Every request of a user except OFF passes `ClientRegistry`, so that only the client in
control can change the session.
"""
