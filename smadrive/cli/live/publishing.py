"""The option `--publish`: what a command publishes, and what it prints about the publication."""

from __future__ import annotations

from collections.abc import Iterator
from contextlib import contextmanager, suppress
from typing import TYPE_CHECKING, Annotated, Any

import typer

from smadrive.cli.terminal.output import Output
from smadrive.control.loop import TickHandler
from smadrive.display.number_text import count_text
from smadrive.errors import ConfigError
from smadrive.rig.config import RigConfig
from smadrive.rig.rig import Rig
from smadrive.stream.published_state import PublishedMode

if TYPE_CHECKING:
    from smadrive.runs.experiments import Watch
    from smadrive.runs.run_log import TickRecorder
    from smadrive.stream.shared_memory import SharedWriter
    from smadrive.telemetry.feed import RunFeed
    from smadrive.telemetry.publication import Publication

Publish = Annotated[
    str | None,
    typer.Option(
        "--publish",
        metavar="URL",
        help="Publish the live values to an MQTT broker: mqtt://USER@HOST:PORT/PREFIX, or mqtts://. "
        "See docs/telemetry.md.",
    ),
]

OFF_BY_MQTT = "`off` from the broker"
"""The text after `stopped by` if the message `off` of the broker has stopped the run."""

MODES = {
    "run": PublishedMode.TRACKING,
    "excite": PublishedMode.EXCITING,
    "heat": PublishedMode.HEATING,
    "watch": PublishedMode.OFF,
}
"""The published `mode` of each command while its ticks arrive."""


class RunPublication:
    """The publication of a run; without `--publish` its methods change nothing."""

    def __init__(self, feed: RunFeed | None, publication: Publication | None) -> None:
        self._feed = feed
        self._publication = publication

    def begin(self, rig: Rig) -> None:
        """Publish the devices of the open rig. From now on, if the rig file permits it, `off` by MQTT stops the run."""
        if self._feed is not None and self._publication is not None:
            self._feed.begin(rig)
            self._publication.on_off = lambda: rig.stop.request(OFF_BY_MQTT)

    def watch(self, watch: Watch) -> Watch:
        """Return a Watch that calls `watch`, and also publishes each tick."""
        feed = self._feed
        if feed is None:
            return watch

        @contextmanager
        def both(recorder: TickRecorder, duration_s: float) -> Iterator[TickHandler]:
            with watch(recorder, duration_s) as record:
                yield each([record, feed.tick])

        return both

    @property
    def takers(self) -> list[TickHandler]:
        """The functions that publish a tick: one, or none without `--publish`."""
        return [] if self._feed is None else [self._feed.tick]

    def result(self) -> dict[str, Any]:
        """Return the counts for `--json` under the key `published`; an empty dict without `--publish`."""
        return {} if self._publication is None else {"published": self._publication.counts._asdict()}


def each(takers: list[TickHandler]) -> TickHandler:
    """Return the function that passes each tick to all `takers`."""
    if len(takers) == 1:
        return takers[0]

    def record(tick: Any) -> None:
        for take in takers:
            take(tick)

    return record


@contextmanager
def run_publication(url: str | None, config: RigConfig, command: str, output: Output) -> Iterator[RunPublication]:
    """Publish to the broker at `url` during the `with` block, which opens and closes the rig.

    At the end of the block, print how many samples the broker has got. If `url` is None, nothing is published.
    """
    if url is None:
        yield RunPublication(None, None)
        return
    from smadrive.stream.shared_memory import SharedWriter  # noqa: PLC0415
    from smadrive.telemetry.feed import RunFeed  # noqa: PLC0415 (most calls publish nothing)

    with (
        SharedWriter() as writer,
        open_publication(url, config, command, writer, output) as publication,
        RunFeed(writer, config, MODES[command]) as feed,
    ):
        yield RunPublication(feed, publication)


@contextmanager
def open_publication(
    url: str, config: RigConfig, command: str, writer: SharedWriter, output: Output
) -> Iterator[Publication]:
    """Publish what is written to `writer` during the `with` block.

    Print at the beginning whether the broker answers, and at the end the counts of samples and connections. With
    `--json`, warnings and counts go to stderr: not every command has a JSON object for them at its end.
    """
    from smadrive.telemetry.address import parse_address  # noqa: PLC0415
    from smadrive.telemetry.publication import Publication  # noqa: PLC0415

    publication = Publication(parse_address(url), config, command, writer)
    try:
        with publication:
            _say_connection(publication, output)
            yield publication
    except BaseException:
        with suppress(ConfigError, OSError):  # a failed print must not hide the error
            _say_counts(publication, output)
        raise
    _say_counts(publication, output)


def _say_connection(publication: Publication, output: Output) -> None:
    is_ready, trouble = publication.wait_for_broker(), publication.counts.trouble
    if is_ready:
        output.say(f"publishing to {publication.address}")
        if trouble:
            output.report(f"warning: {publication.address}: {trouble}")
    else:
        reason = f"{trouble or 'no answer yet'}; the command goes on, and samples wait for the broker"
        output.report(f"warning: {publication.address}: {reason}")


def _say_counts(publication: Publication, output: Output) -> None:
    if not publication.has_begun:
        return
    counts = publication.counts
    output.report(
        f"published: {counts.samples} samples, {counts.dropped} dropped, {counts.waiting} not confirmed, "
        f"{count_text(counts.connections, 'connection')}"
    )
    if counts.samples == 0 and counts.waiting + counts.dropped > 0:
        reason = f"{counts.trouble or 'the broker has confirmed no sample'}; check the address and the broker"
        output.report(f"warning: nothing was published to {publication.address}: {reason}")
    elif counts.trouble:
        output.report(f"warning: {publication.address}: {counts.trouble}")
