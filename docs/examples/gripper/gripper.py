"""A gripper whose finger is moved by a shape-memory-alloy wire."""

import smadrive


class Hold:
    """Holds the finger at a displacement: a PI controller."""

    def __init__(self, position_mm, duration_s):
        self.position_mm = position_mm
        self.duration_s = duration_s
        self.current_a = 0.2

    def update(self, time_s, measurement, dt_s):
        error_mm = self.position_mm - measurement.displacement_mm
        self.current_a += 0.01 * error_mm * dt_s
        return smadrive.Command(self.current_a + 0.03 * error_mm, setpoint_mm=self.position_mm)


def grip(rig_file, wire, position_mm=5.0, duration_s=20.0):
    """Grip for `duration_s`; the run."""
    with smadrive.open_rig(rig_file) as rig:
        return rig.drive(Hold(position_mm, duration_s), wire)
