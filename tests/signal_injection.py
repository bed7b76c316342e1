"""A signal at a chosen source line."""

import sys


def interrupt_main():
    """Raise KeyboardInterrupt."""
    raise KeyboardInterrupt


class InterruptedLine:
    """A context manager that calls `interrupt` before one line of `modules`, and suppresses KeyboardInterrupt.

    `interrupt` raises KeyboardInterrupt there, as the handler of SIGINT does, or sends a signal to this process.
    `at` counts the lines of `modules` that run in the `with` block, beginning with 0. `reached` tells if the block had
    so many lines. A test that increments `at` until `reached` is False interrupts the block once at each line.
    `error` keeps the KeyboardInterrupt, and with it every object of the interrupted calls, as a shutdown does.
    """

    def __init__(self, at, *modules, interrupt=interrupt_main):
        self.reached = False
        self.error = None
        self._left = at
        self._interrupt = interrupt
        self._files = {module.__file__ for module in modules}

    def __enter__(self):
        self._before = sys.gettrace()
        sys.settrace(self._on_call)
        return self

    def __exit__(self, kind, error, trace):
        sys.settrace(self._before)
        self.error = error
        return kind is KeyboardInterrupt

    def _on_call(self, frame, _event, _argument):
        return self._on_line if frame.f_code.co_filename in self._files else None

    def _on_line(self, _frame, event, _argument):
        if event == "line":
            if self._left == 0:
                self.reached = True
                sys.settrace(None)
                self._interrupt()
                return None
            self._left -= 1
        return self._on_line
