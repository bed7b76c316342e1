"""`smadrive campaign`: many simulated runs, or many fits, on the cores of this machine or on a Dask cluster."""

from __future__ import annotations

import shlex
from collections.abc import Iterator
from contextlib import AbstractContextManager, contextmanager
from pathlib import Path
from typing import TYPE_CHECKING, Annotated

import typer

from smadrive.campaigns.execution.cluster import (
    local_client,
    remote_client,
    threads_of,
    usable_cores,
    usable_memory_bytes,
)
from smadrive.cli.terminal.output import AsJson, Output
from smadrive.cli.views.announcement import duration_text
from smadrive.cli.views.campaign_view import (
    CampaignView,
    estimate_line,
    print_summary,
    result_object,
)
from smadrive.errors import ConfigError, TransportError
from smadrive.files.extras import check_extra
from smadrive.posix import check_posix

if TYPE_CHECKING:
    from distributed import Client

    from smadrive.campaigns.execution.journal import Journal


def main(
    campaign: Annotated[str, typer.Argument(help="Campaign file (.toml), or the name of a shipped campaign.")],
    folder: Annotated[
        Path,
        typer.Option(
            "--output-dir",
            "-o",
            help="Empty folder for the table, the logs and the report; with --resume, the folder of the campaign.",
        ),
    ],
    resume: Annotated[
        bool, typer.Option("--resume", help="Go on with the interrupted campaign in this folder.")
    ] = False,
    scheduler: Annotated[
        str | None,
        typer.Option(help="Address of a Dask scheduler, such as tcp://host:8786. Its network must be trusted."),
    ] = None,
    workers: Annotated[
        int | None,
        typer.Option(min=1, max=1024, help="Number of worker processes on this machine; by default one per core."),
    ] = None,
    as_json: AsJson = False,
) -> None:
    """Execute the runs that the file CAMPAIGN describes, and write a table and a report.

    Everything is simulated in virtual time. Ctrl-C ends the command, and --resume goes on with the remaining runs. The
    same file and seed give the same table, to the last bit, whatever the number of workers.
    """
    check_posix()
    check_extra("campaign", "smadrive campaign")
    if scheduler is not None and workers is not None:
        cure = "leave one of the two out: --scheduler uses the workers of that cluster"
        raise ConfigError("not together with --scheduler", where="--workers", value=workers, cure=cure)
    _conduct(campaign, folder, Output(as_json), resume=resume, scheduler=scheduler, workers=workers)


def _conduct(
    campaign: str, folder: Path, output: Output, *, resume: bool, scheduler: str | None, workers: int | None
) -> None:
    # imported here, because these modules need the extra `campaign`, and the help must work without it
    from smadrive.campaigns.campaign import check_plan, conduct  # noqa: PLC0415
    from smadrive.campaigns.execution.estimate import check_disk, estimated, memory_caveats  # noqa: PLC0415
    from smadrive.campaigns.execution.journal import Journal  # noqa: PLC0415
    from smadrive.campaigns.execution.scheduling import groups_of  # noqa: PLC0415
    from smadrive.campaigns.plan.plan import load_plan  # noqa: PLC0415

    plan = load_plan(campaign)
    with output.progress("checking the runs"):
        check_plan(plan)
    command = _resume_command(campaign, folder, scheduler, workers, as_json=output.quiet)
    with Journal(folder, plan, resume=resume) as journal, _resumable(journal, plan.count, command):
        with output.progress("estimating time and disk space"):
            groups = groups_of(plan, set(journal.results))
            estimate = estimated(plan, groups)
        check_disk(folder, estimate)
        with _client(scheduler, workers) as client:
            threads = threads_of(client)
            output.say(estimate_line(plan, len(journal.results), estimate, threads))
            output.warn(memory_caveats(threads, usable_memory_bytes()) if scheduler is None else ())
            output.say(f"dashboard: {client.dashboard_link}")
            with CampaignView(plan.count, len(journal.results), output) as view:
                result = conduct(client, plan, groups, journal, view)
    print_summary(output, plan, result)
    output.say(f"took {duration_text(view.elapsed_s)}")
    output.result(result_object(plan, result))
    if (result.table["status"] == "failed").all():
        first = str(result.table["error"].iloc[0])
        if result.not_final == plan.count:
            cure = "repair the workers, and go on with --resume"
            raise TransportError("every run failed", where="workers", value=first, cure=cure)
        raise ConfigError("every run failed", where=campaign, value=first, cure="correct the campaign file")


def _client(scheduler: str | None, workers: int | None) -> AbstractContextManager[Client]:
    return local_client(workers or usable_cores()) if scheduler is None else remote_client(scheduler)


@contextmanager
def _resumable(journal: Journal, count: int, command: str) -> Iterator[None]:
    """Add a note to an error or interruption in the `with` block: what is finished, and how to go on.

    `command` is the command that goes on with the rest: the remaining runs, the logs and the report.
    """
    try:
        yield
    except BaseException as error:
        if done := len(journal.results) - journal.not_final:
            finished = f"{done} of {count} runs are done" if done < count else "all runs are done, the report is not"
            error.add_note(f"{finished}; go on with `{command}`")
        raise


def _resume_command(campaign: str, folder: Path, scheduler: str | None, workers: int | None, *, as_json: bool) -> str:
    """Return the command that goes on with the campaign on the same workers, quoted for a shell."""
    words = ["smadrive", "campaign", campaign, "-o", str(folder), "--resume"]
    words += [] if scheduler is None else ["--scheduler", scheduler]
    words += [] if workers is None else ["--workers", str(workers)]
    return shlex.join([*words, "--json"] if as_json else words)
