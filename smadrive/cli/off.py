"""`smadrive off`: put every device of a rig into its safe state, confirmed by read-back."""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import asdict
from typing import Annotated

import typer

from smadrive.cli.parsing.options import RigFile
from smadrive.cli.terminal.output import AsJson, Output
from smadrive.cli.terminal.stdout import use_stderr_if_stdout_fails
from smadrive.errors import SafetyError
from smadrive.rig.switching_off.guardians import notes_waiting_guardians, waiting_guardians
from smadrive.rig.switching_off.switch_off import SwitchedOff, stopped_before, switch_off

ClearFaults = Annotated[bool, typer.Option("--clear-faults", help="Also clear latched faults; remove the cause first.")]


def main(rig: RigFile, clear_faults: ClearFaults = False, as_json: AsJson = False) -> None:
    """Emergency stop: stop the driver of RIG, if one runs, and switch the heater off, confirmed by read-back.

    The exit code is 0 only if the heater is confirmed off, every other device is in its safe state, and no fault
    persists that should be cleared. With --json, `safe` is true if the heater is confirmed off and every other device
    is in its safe state; `failure` holds the error if the exit code is not 0. If standard output cannot be written, the
    text goes to standard error, and the exit code stays the same.
    """
    use_stderr_if_stdout_fails()
    output = Output(as_json)
    with notes_waiting_guardians():
        try:
            off = switch_off(rig, clear_faults=clear_faults)
        except Exception as unconfirmed:
            output.result(_unconfirmed(rig, unconfirmed))
            raise
    waiting, warnings = _waiting_guardians((*off.warnings, *_simulated(off)))
    for driver in off.stopped:
        output.say(str(driver))
    shown = (f"{name}, simulated by this command" if name in off.simulated else name for name in off.devices)
    output.say(f"{off.rig}: heater off, confirmed by read-back ({', '.join(shown)})")
    if off.latched:
        output.say(f"latched: {', '.join(off.latched)} (clear with --clear-faults)")
    for guardian in waiting:
        output.say(guardian)
    output.warn(warnings)
    failure = _failure(off)
    error = failure or off.uncleared
    output.result(
        {
            "rig": off.rig,
            "devices": off.devices,
            "simulated": off.simulated,
            "stopped_drivers": [asdict(driver) for driver in off.stopped],
            "safe": failure is None,
            "failure": None if error is None else str(error),
            "faults": off.latched,
            "waiting_guardians": waiting,
            "warnings": warnings,
        }
    )
    if error is not None:
        raise error


def _unconfirmed(rig: str, error: Exception) -> dict[str, object]:
    """Return the JSON object for a heater that is not confirmed off, with the error of `switch_off`."""
    waiting, warnings = _waiting_guardians(())
    return {
        "rig": rig,
        "devices": (),
        "simulated": (),
        "stopped_drivers": [asdict(driver) for driver in stopped_before(error)],
        "safe": False,
        "failure": str(error),
        "faults": (),
        "waiting_guardians": waiting,
        "warnings": warnings,
    }


def _failure(off: SwitchedOff) -> Exception | None:
    """Return the error with which the command ends; None if every device is in its safe state.

    A driver that may heat again is the worst error, then a device that may heat elsewhere.
    """
    if off.refused is None and off.displaced:
        return SafetyError(
            "another device was at the port before and may still heat",
            where=off.rig,
            cure="connect that device again, or cut its supply; a line above names its guardian",
        )
    return off.refused or off.failure


def _simulated(off: SwitchedOff) -> Iterator[str]:
    """Yield a warning if devices are simulated: another program simulates its own devices, so its run goes on."""
    if off.simulated:
        names = " and ".join(f"'{name}'" for name in off.simulated)
        yield (
            f"each program simulates {names} (sim://) for itself, so a run in another terminal goes on: "
            "end it with Ctrl-C there, or with `kill`"
        )


def _waiting_guardians(warnings: tuple[str, ...]) -> tuple[list[str], list[str]]:
    """Return a sentence for each guardian that still waits for its device, and `warnings` as a list.

    If the state folder is unreadable, the guardians are unknown. Then add a warning, and raise no error, which would
    hide whether the heater is off.
    """
    try:
        return waiting_guardians(), [*warnings]
    except SafetyError as error:
        return [], [*warnings, f"the guardians that still wait are unknown: {error}"]
