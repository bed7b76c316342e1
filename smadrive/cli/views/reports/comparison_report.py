"""The page of runs side by side: how each run ended, metrics, settings that differ, plots, files."""

from __future__ import annotations

from collections.abc import Iterator
from pathlib import Path

from smadrive.cli.views.reports.log_report import clock_text, state_of
from smadrive.runs.comparison.comparison import RunComparison
from smadrive.runs.figures.comparison_plots import comparison_plots
from smadrive.runs.metrics.caveats import run_caveats
from smadrive.runs.report import Banner, Grid, Notes, PagePart, write_report

SAME = "The runs have the same settings."
FIRST = "In brackets: the difference from the first run. Errors are in % of the stroke of the run's model."


def write_comparison_report(path: Path, comparison: RunComparison) -> None:
    """Write the page of the compared runs to `path`. DataError when a log lacks content, or the page is unwritable."""
    parts: list[PagePart] = [
        *_banners(comparison),
        Grid(("", *comparison.names), comparison.metric_rows(), "Metrics"),
        Notes([FIRST]),
        Grid(("setting", *comparison.names), setting_rows(comparison), "Settings that differ", texts=True),
        *comparison_plots(comparison),
        _files(comparison),
    ]
    lead = " · ".join(
        f"{name}: {log.text('kind')}" for name, log in zip(comparison.names, comparison.logs, strict=True)
    )
    write_report(path, f"{len(comparison.logs)} runs side by side", lead, parts)


def setting_rows(comparison: RunComparison) -> list[tuple[str, ...]]:
    """Return the rows of the settings that differ: the name, then the value in each run; a dash stands for no value."""
    rows: list[tuple[str, ...]] = [
        (name, *(text or "–" for text in texts)) for name, texts in comparison.settings.items()
    ]
    return rows or [(SAME, *("" for _ in comparison.logs))]


def comparison_caveats(comparison: RunComparison) -> list[str]:
    """Return the reasons to distrust a run, each after the name of its run."""
    pairs = zip(comparison.names, comparison.logs, strict=True)
    return [f"{name}: {caveat}" for name, log in pairs for caveat in run_caveats(log)]


def _banners(comparison: RunComparison) -> Iterator[Banner]:
    for name, log, metrics in zip(comparison.names, comparison.logs, comparison.metrics, strict=True):
        state = state_of(log, metrics)
        if state.level != "good":
            yield Banner(state.level, f"{name}: {state.text}")
    for caveat in comparison_caveats(comparison):
        yield Banner("warning", f"Warning: {caveat}.")


def _files(comparison: RunComparison) -> Grid:
    rows = [
        (name, str(log.path), clock_text(log.start_time), clock_text(log.end_time) or "not ended")
        for name, log in zip(comparison.names, comparison.logs, strict=True)
    ]
    return Grid(("run", "log", "begun", "ended"), rows, "Provenance", texts=True)
