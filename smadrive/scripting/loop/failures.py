"""The failure of a request as a message to the script: errors that pickle, with the outcome of the shutdown."""

from __future__ import annotations

import pickle
import traceback

from smadrive.errors import ControllerError, SafetyError, SmadriveError, StoppedError
from smadrive.safety.shutdown import carry, keep_outcome, shutdown_of
from smadrive.scripting.loop.code_origin import dumps
from smadrive.scripting.loop.messages import Failure
from smadrive.scripting.loop.script_process import STOPPED_S


def stopped_script(interruption: KeyboardInterrupt) -> SafetyError:
    """Return the error of a request that was interrupted because the script was stopped."""
    outcome = shutdown_of(interruption)
    done = "the heater was switched off" if outcome is not None and outcome.ended_run else "the request has ended"
    cure = "let the script run until its request is done (Ctrl-Z, SIGSTOP and gdb stop it)"
    error = SafetyError(f"the script was stopped, so {done}", limit=f"{STOPPED_S:g} s", cure=cure)
    if outcome is not None:
        carry(error, outcome)
    return error


def dumped_failure(number: int, error: BaseException, *, is_own_code: bool) -> bytes:
    """Return the message that the request `number` failed with `error`.

    It has the traceback if code of the user may have raised the error (`is_own_code`), or if the error is a defect.
    """
    is_plain = isinstance(error, KeyboardInterrupt | StoppedError) or (
        isinstance(error, SmadriveError) and not is_own_code
    )
    text = "" if is_plain else "".join(traceback.format_exception(error))
    keep_outcome(error)
    if isinstance(error, StoppedError) and (outcome := shutdown_of(error)) is not None and outcome.confirmed:
        error.args = (f"{error}; {outcome}",)
    return _dumped(number, error, text)


def _dumped(number: int, error: BaseException, text: str) -> bytes:
    """Return the pickled failure; an error that cannot be transferred becomes a ControllerError with its text."""
    try:
        message = dumps((number, Failure(error, text)))
        pickle.loads(message)  # noqa: S301 (some errors can be pickled, but not restored)
    except Exception:  # noqa: BLE001 (pickling runs code of the user)
        substitute = ControllerError(f"{type(error).__qualname__}: {error}", where="own code")
        if (outcome := shutdown_of(error)) is not None:
            carry(substitute, outcome)
        return pickle.dumps((number, Failure(substitute, text)))
    return message
