"""The text of a rig file with a supply and a thermocouple reader, in which tests fill in the ports."""

RIG = """
name = "supply and reader"
wire = "flexinol-lt-0.15mm"
rate_hz = 4.0
[[devices]]
name = "supply"
profile = "riden-rd60xx"
url = "{supply}"
[[devices]]
name = "reader"
profile = "delta-dtb"
url = "{reader}"
[limits]
current_max_a = 0.6
temperature_max_c = 135.0
voltage_max_v = 15.0
watchdog_s = 1.0
stale_after_s = 1.0
[excitation]
low_c = 40.0
high_c = 120.0
rate_c_per_s = 6.0
"""
