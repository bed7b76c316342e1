"""smadrive for scripts and notebooks: the open rig, runs, wires, progress. The loop runs in a separate process.

`import smadrive` gives the public names. This package may import runs and everything below runs. The experiments belong
to runs, because the commands use them, too.
"""
