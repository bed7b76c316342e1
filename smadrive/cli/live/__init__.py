"""Shows a run outside the terminal: publishes it for `--publish`, and serves its page in the browser.

Commands share it. It may import tuning, telemetry, rig and everything below them, and `cli.terminal`.
"""
