"""Real-time scheduling of the loop, its guardian and a served simulator, and a system that does not permit it."""

import os
import sys

import programs
from process_tree import guardians
from served import PATIENT, served

from smadrive.control.controllers.step import ConstantCurrentController
from smadrive.devices.guardian.client import GuardianClient
from smadrive.devices.guardian.task import GuardedDevice, Task
from smadrive.real_time import LOOP_PRIORITY
from smadrive.rig.config import load_rig
from smadrive.rig.rig import Rig

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


def test_loop_of_a_rig_on_a_port_has_real_time_scheduling_as_long_as_it_runs():
    policies = []

    def ignore(tick):
        pass

    def stop_requested():
        policies.append(os.sched_getscheduler(0) & ~os.SCHED_RESET_ON_FORK)
        return len(policies) > 2

    with served("--tcp", "0") as (_, url):
        config = load_rig("simulated").at(url + PATIENT)
        limits = config.limits.model_copy(update={"watchdog_s": 5.0})
        with Rig(config.model_copy(update={"limits": limits})) as rig:
            rig.drive(ConstantCurrentController(0.0, 1.0), rig.nominal_balance, ignore, stop_requested=stop_requested)
    assert set(policies) == {policy_after() & ~os.SCHED_RESET_ON_FORK}
    assert os.sched_getscheduler(0) & ~os.SCHED_RESET_ON_FORK == os.SCHED_OTHER
