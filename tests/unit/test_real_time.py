"""Real-time scheduling of the loop, its guardian and a served simulator, and a system that does not permit it."""

import os
import sys

import programs
from process_tree import guardians
from served import served

from smadrive.devices.guardian.client import GuardianClient
from smadrive.devices.guardian.task import GuardedDevice, Task
from smadrive.real_time import LOOP_PRIORITY

PRINT_POLICY = "from smadrive.real_time import *; {before} use_real_time_scheduling(); print(os.sched_getscheduler(0))"
UNPRIVILEGED = "import resource; resource.setrlimit(resource.RLIMIT_RTPRIO, (0, 0)); os.geteuid() or os.setuid(65534);"


def policy_after(before=""):
    """Return the policy that the system grants to a process which asks for real-time scheduling."""
    code = f"import os; {PRINT_POLICY.format(before=before)}"
    return int(programs.run([sys.executable, "-c", code], capture_output=True, text=True, check=True).stdout)


def test_without_permission_the_process_goes_on_with_ordinary_scheduling():
    assert policy_after(UNPRIVILEGED) == os.SCHED_OTHER


def test_simulator_in_real_time_has_the_scheduling_of_the_loop():
    with served("--tcp", "0") as (process, url):
        assert url.startswith("tcp://")
        assert os.sched_getscheduler(process.pid) == policy_after()


def test_simulator_in_lockstep_time_has_ordinary_scheduling():
    with served("--tcp", "0", "--time", "lockstep") as (process, url):
        assert url.startswith("tcp://")
        assert os.sched_getscheduler(process.pid) == os.SCHED_OTHER


def test_guardian_has_a_higher_priority_than_a_loop_that_hangs():
    task = Task(GuardedDevice("riden-rd60xx", "serial:///dev/null", None), timeout_s=10.0)
    with GuardianClient(task, lambda: None) as client:
        client.configure({})
        (guardian,) = guardians(os.getpid())
        assert os.sched_getscheduler(guardian) == policy_after()
        assert policy_after() == os.SCHED_OTHER or os.sched_getparam(guardian).sched_priority > LOOP_PRIORITY
