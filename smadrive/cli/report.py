"""`smadrive report`: show a log as one page, and write it as a CSV file for other programs."""

from __future__ import annotations

from dataclasses import asdict
from pathlib import Path
from typing import Annotated

import typer

from smadrive.cli.output import AsJson, Output
from smadrive.cli.views.log_report import write_log_report
from smadrive.files.atomic import check_output
from smadrive.files.csv_table import write_table
from smadrive.files.kinds import LOG, PAGE, TABLE, check_kind
from smadrive.runs.log.reader import read_log
from smadrive.runs.session_record import plain_events


def main(
    log_file: Annotated[Path, typer.Argument(metavar="LOG", help="Log (.h5) of `run`, `excite`, `tune` or `demo`.")],
    report_file: Annotated[
        Path | None,
        typer.Option("--report-file", "-o", help="Page (HTML) to write; LOG with the ending .html by default."),
    ] = None,
    csv_file: Annotated[Path | None, typer.Option("--csv", help="CSV to write with every column of the log.")] = None,
    as_json: AsJson = False,
) -> None:
    """Show the run in LOG on one self-contained page: plots, metrics, faults, provenance. The log may be incomplete."""
    output = Output(as_json)
    check_kind(log_file, LOG)
    page = report_file or log_file.with_suffix(".html")
    check_output(page, PAGE, log_file)
    if csv_file is not None:
        check_output(csv_file, TABLE, log_file)
    log = read_log(log_file)
    output.warn(log.caveats)
    with output.progress(f"drawing {log_file.name}"):
        summary = write_log_report(page, log)
        if csv_file is not None:
            write_table(csv_file, {}, log.columns)
    output.say(f"report: {page}" + ("" if csv_file is None else f"   CSV: {csv_file}"))
    output.result(
        {
            "log_file": str(log_file),
            "report_file": str(page),
            "csv_file": None if csv_file is None else str(csv_file),
            "complete": bool(log.end_time) and not log.ended_by,
            "ended_by": log.ended_by if log.end_time else "a kill, or it still runs",
            **asdict(summary),
            "caveats": log.caveats,
            "events": [event._asdict() for event in plain_events(log)],
        }
    )
