"""`smadrive report`: show a log as one page, or several side by side; write a log as a CSV file for other programs."""

from __future__ import annotations

from dataclasses import asdict
from pathlib import Path
from typing import Annotated, Any

import typer

from smadrive.cli.terminal.output import AsJson, Output
from smadrive.cli.views.reports.comparison_report import SAME, comparison_caveats, setting_rows, write_comparison_report
from smadrive.cli.views.reports.log_report import write_log_report
from smadrive.errors import ConfigError
from smadrive.files.atomic import check_output
from smadrive.files.csv_table import write_table
from smadrive.files.kinds import LOG, PAGE, TABLE, check_kind
from smadrive.runs.comparison.comparison import RunComparison
from smadrive.runs.cycling.cycles import cycles_of
from smadrive.runs.health.assessment import assessment_of, health_values
from smadrive.runs.log.reader import Log, read_log
from smadrive.runs.metrics.caveats import run_caveats
from smadrive.runs.session_record import plain_events


def main(
    log_files: Annotated[
        list[Path],
        typer.Argument(metavar="LOG", help="Log (.h5) of a run, a tuning session or `watch -o`; or several logs."),
    ],
    report_file: Annotated[
        Path | None,
        typer.Option(
            "--report-file",
            "-o",
            help="Page (HTML) to write; LOG with the ending .html by default, -comparison.html for several logs.",
        ),
    ] = None,
    csv_file: Annotated[Path | None, typer.Option("--csv", help="CSV to write with every column of the log.")] = None,
    as_json: AsJson = False,
) -> None:
    """Show the run in LOG on one self-contained page: plots, metrics, faults, provenance. The log may be incomplete.

    Several logs are shown side by side: the metrics with their differences from the first run, the settings that
    differ, and plots with all runs.
    """
    output = Output(as_json)
    for log_file in log_files:
        check_kind(log_file, LOG)
    if len(log_files) > 1:
        _compare(log_files, report_file, csv_file, output)
        return
    (log_file,) = log_files
    page = report_file or log_file.with_suffix(".html")
    check_output(page, PAGE, log_file)
    if csv_file is not None:
        check_output(csv_file, TABLE, log_file)
    log = read_log(log_file)
    caveats = run_caveats(log)
    output.warn(caveats)
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
            **_end(log),
            **asdict(summary),
            "caveats": caveats,
            "events": [event._asdict() for event in plain_events(log)],
            **({} if (found := assessment_of(log)) is None else {"wire": health_values(found)}),
            **({"cycles": [asdict(one) for one in cycles]} if (cycles := cycles_of(log)) else {}),
        }
    )


def _compare(log_files: list[Path], report_file: Path | None, csv_file: Path | None, output: Output) -> None:
    """Show several logs side by side. ConfigError with `csv_file`, which needs a single log."""
    if csv_file is not None:
        raise ConfigError(
            "this option takes a single log",
            where="--csv",
            value=f"{len(log_files)} logs",
            cure="give one log at a time",
        )
    page = report_file or log_files[0].with_name(f"{log_files[0].stem}-comparison.html")
    check_output(page, PAGE, *log_files)
    comparison = RunComparison(tuple(map(read_log, log_files)))
    with output.progress(f"drawing {len(log_files)} runs"):
        write_comparison_report(page, comparison)
    output.table(("", *comparison.names), comparison.metric_rows())
    if comparison.settings:
        output.table(("setting", *comparison.names), setting_rows(comparison))
    else:
        output.say(SAME)
    output.warn(comparison_caveats(comparison))
    output.say(f"report: {page}")
    output.result({"report_file": str(page), "runs": _runs(comparison), "settings": comparison.settings})


def _runs(comparison: RunComparison) -> list[dict[str, Any]]:
    parts = zip(comparison.names, comparison.logs, comparison.metrics, comparison.differences(), strict=True)
    return [
        {"name": name, "log_file": str(log.path), **_end(log), **asdict(metrics), "differences": differences}
        for name, log, metrics, differences in parts
    ]


def _end(log: Log) -> dict[str, Any]:
    """Return the JSON keys that tell how the run ended: `complete` (a bool) and `ended_by` (a text)."""
    return {
        "complete": bool(log.end_time) and not log.ended_by,
        "ended_by": log.ended_by if log.end_time else "a kill, or it still runs",
    }
