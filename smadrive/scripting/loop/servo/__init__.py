"""The servo in the loop process: its controller, its motions, and its messages from and to the script.

This package may import what `scripting.loop` may import. The servo that a script uses belongs to `scripting`.
"""
