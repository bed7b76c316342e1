"""The source of the displacement on a rig: what the resistance of the wire can measure there.

May import wire, devices and the plan of the rig. Estimation belongs to control.
"""
