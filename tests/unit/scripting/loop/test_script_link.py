"""The loop process notices the end of its script, and an interruption of a request, at any time."""

import signal
import subprocess
import sys

import programs
import pytest

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


STOPPED_DURING_A_SWITCHING_OFF = """
import sys, time
from smadrive.interrupts import HeldSignals
from smadrive.scripting.loop import script_link, script_process

script_link.LOOK_S, script_process.STOPPED_S = 0.02, 0.1
link = script_link.ScriptLink(int(sys.argv[1]))
link.opening()
with link.interruptible(), HeldSignals() as held:
    print("switching off", flush=True)
    while not held.received:
        time.sleep(0.02)
    time.sleep(0.5)
    print(len(held.received), flush=True)
"""
SCRIPT = """
import pickle, subprocess, sys
from multiprocessing import Pipe
from smadrive.scripting.loop.messages import NUMBER_BYTES, REQUEST

script, loop = Pipe()
script.send_bytes(REQUEST + bytes(NUMBER_BYTES) + pickle.dumps("request"))
subprocess.run([sys.executable, "-c", sys.argv[1], str(loop.fileno())], pass_fds=[loop.fileno()])
"""


@pytest.mark.exhaustive
@pytest.mark.skipif(sys.platform != "linux", reason="only Linux shows the state of a process")
def test_script_that_stays_stopped_interrupts_its_request_once():
    """Three signals would end the tries to switch off."""
    command = [sys.executable, "-c", SCRIPT, STOPPED_DURING_A_SWITCHING_OFF]
    with programs.Program(command, stdout=subprocess.PIPE, text=True) as script:
        assert script.stdout.readline() == "switching off\n"
        script.send_signal(signal.SIGSTOP)
        assert script.stdout.readline() == "1\n"
        script.send_signal(signal.SIGCONT)


INTERRUPTS_A_REQUEST = """
import __main__, os, pickle, threading
from multiprocessing import Pipe
from smadrive.scripting.loop.messages import COMMAND, INTERRUPT, NUMBER_BYTES, REQUEST
from smadrive.scripting.loop.script_link import ScriptLink

threading.Timer(60.0, os._exit, (1,)).start()
script, loop = Pipe()

def interrupt(number):
    script.send_bytes(INTERRUPT + number.to_bytes(NUMBER_BYTES))

def await_listener():
    script.send_bytes(COMMAND + pickle.dumps(("servo", "command")))
    link.next_command("servo", waits=True)

def caught(act):
    try:
        act()
    except KeyboardInterrupt:
        pass

class Restored:
    def __init__(self, act):
        self.act = act
    def __reduce__(self):
        return self.act, ()

def during():
    interrupt(1)
    threading.Event().wait(5.0)

def swallowed():
    caught(during)
    return "request"

def send(number, request):
    script.send_bytes(REQUEST + number.to_bytes(NUMBER_BYTES) + pickle.dumps(request))

def carry_out():
    try:
        request = link.request()
        with link.interruptible():
            print("begun", flush=True)
    except KeyboardInterrupt:
        print("interrupted", flush=True)

__main__.during, __main__.swallowed = during, swallowed
link = ScriptLink(loop.fileno())
{how}
carry_out()
send(2, "request")
carry_out()
os._exit(0)
"""
INTERRUPTED = {
    "before it is taken": "send(1, 'request'); interrupt(1); await_listener()",
    "while it is restored": "send(1, Restored(during))",
    "while it is restored, and caught": "send(1, Restored(swallowed))",
}


@pytest.mark.parametrize("how", INTERRUPTED.values(), ids=INTERRUPTED)
def test_request_that_is_interrupted_early_does_not_begin(how):
    command = [sys.executable, "-c", INTERRUPTS_A_REQUEST.format(how=how)]
    done = programs.run(command, stdout=subprocess.PIPE, text=True, check=True)
    assert done.stdout == "interrupted\nbegun\n"
