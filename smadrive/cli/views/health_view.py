"""The health of a wire on the terminal: a table of its drifts, and the verdict."""

from __future__ import annotations

from smadrive.cli.terminal.output import Output
from smadrive.runs.health.assessment import HEADER, Assessment, health_lines, health_rows


def show_health(output: Output, assessment: Assessment) -> None:
    """Print the drifts of the wire and the verdict. Without a health record, print only the caveats."""
    output.warn(assessment.caveats)
    if assessment.health is None:
        return
    rows = list(health_rows(assessment.health))
    if rows:
        output.table(HEADER, rows)
    for line in health_lines(assessment.health):
        output.say(f"wire: {line}")
