"""The loop process notices the end of its script at any time."""

import subprocess
import sys

import programs

ENDS_DURING_A_SWITCHING_OFF = """
import os, threading
from multiprocessing import Pipe
from smadrive.interrupts import HeldSignals
from smadrive.scripting.loop.messages import END, ScriptEndedError
from smadrive.scripting.loop.script_link import ScriptLink

threading.Timer(60.0, os._exit, (1,)).start()
script, loop = Pipe()
link = ScriptLink(loop.fileno())
with link.interruptible(), HeldSignals() as held:
    script.send_bytes(END)
    while not held.received:
        pass
try:
    link.request()
except ScriptEndedError:
    print("ended", flush=True)
os._exit(0)
"""


def test_end_of_the_script_while_signals_are_held_ends_the_loop_process():
    command = [sys.executable, "-c", ENDS_DURING_A_SWITCHING_OFF]
    done = programs.run(command, stdout=subprocess.PIPE, text=True, check=True)
    assert done.stdout == "ended\n"
