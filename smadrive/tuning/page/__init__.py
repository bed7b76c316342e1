"""The page process: bokeh documents that show what the loop publishes and send requests of their user.

May import bokeh, identification (for fits), hysteresis and `tuning.link`. It never touches a device, and every act of a
user passes `ClientRegistry`, so that only the client with the token in control can request anything.
"""
