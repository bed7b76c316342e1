"""What commands share that show a run outside the terminal: `--publish` and the page in the browser.

It may import tuning, telemetry, rig and everything below them, and `cli.terminal`.
"""
