"""`smadrive tune`: the live tuning page."""

from __future__ import annotations

import json
import os
import secrets
from collections.abc import Iterator
from contextlib import AbstractContextManager, ExitStack, contextmanager, nullcontext, suppress
from datetime import UTC, datetime
from itertools import count
from pathlib import Path
from typing import TYPE_CHECKING, Annotated

import typer

from smadrive.cli.live.page import check_real_time, opened
from smadrive.cli.live.publishing import OFF_BY_MQTT, Publish, open_publication
from smadrive.cli.parsing.options import PAGE_PORT, ModelFile, RigFile, model_file
from smadrive.cli.terminal.output import AsJson, Output, make_folder
from smadrive.cli.views.tune_view import TuneView, watched
from smadrive.control.references.limits import check_rig_limits
from smadrive.control.references.reference import Reference
from smadrive.control.references.slow_sine import slow_sine, slow_sine_name
from smadrive.errors import ConfigError
from smadrive.files.extras import check_extra
from smadrive.hysteresis import HysteresisModel
from smadrive.real_time import use_real_time_scheduling
from smadrive.rig.config import LimitsConfig, RigConfig, load_rig, rig_file
from smadrive.rig.rig import Rig
from smadrive.runs.experiments import read_reference
from smadrive.runs.health.assessment import assess, expected_of
from smadrive.runs.health.recording import health_recorded
from smadrive.runs.run_log import WIRE_FILE, record_session
from smadrive.tuning.link.channel import DriverEnd, check_wire
from smadrive.tuning.processes import BuilderProcess, TuningPage
from smadrive.tuning.session.session import TuningSession
from smadrive.tuning.tuning import Tuning
from smadrive.wire.identified_wire import load_wire
from smadrive.wire.wire_model import travel_mm
from smadrive.wire.wire_properties import WireProperties

if TYPE_CHECKING:
    from smadrive.telemetry.publication import Publication


def main(
    rig: RigFile,
    reference: Annotated[
        list[str] | None,
        typer.Option(
            help="Reference for the page: CSV (time_s, displacement_mm) or sine:low_mm=…. May be given several times."
        ),
    ] = None,
    model: ModelFile = None,
    folder: Annotated[
        Path, typer.Option("--output-dir", "-o", help="Folder for the log, and for saved models and rigs.")
    ] = Path(),
    port: Annotated[
        int, typer.Option(min=0, max=65535, help="Port of the page on 127.0.0.1; 0 picks a free one.")
    ] = PAGE_PORT,
    browser: Annotated[bool, typer.Option(help="Open the page in the browser.")] = True,
    publish: Publish = None,
    as_json: AsJson = False,
) -> None:
    """Open the live tuning page of RIG. Ctrl-C switches the heater off and ends the command.

    The session is logged in a new file, whose name is printed at the end.
    """
    check_extra("tune", "smadrive tune")
    output = Output(as_json)
    config = load_rig(rig)
    wire = load_wire(model_file(config, model))
    check_wire(wire.text(), wire.caveats, wire.source)
    tuning = Tuning.of(wire.model, config.feedback, "as loaded", wire.caveats, config.displacement_from)
    references = _references(reference or [], wire.model, config.limits)
    with (
        _named_at_the_end(output) as log_files,
        BuilderProcess() as builder,
        DriverEnd() as channel,
        _publication(publish, config, channel, output) as publication,
        ExitStack() as rig_use,
    ):
        open_rig = rig_use.enter_context(Rig(config))
        properties = WireProperties(wire.heat_balance or open_rig.nominal_balance, wire.resistance, wire.sections_c)
        _check(open_rig, properties, tuning, output)
        check_real_time(open_rig)
        if publication is not None:
            publication.on_off = lambda: open_rig.stop.request(OFF_BY_MQTT)
        page = TuningPage(channel, port=port, token=secrets.token_urlsafe(16), rig_file=rig_file(rig), folder=folder)
        view = TuneView(config.name, page, channel)
        log_file = new_log_file(folder)
        begun_with = properties.identified(wire.model)
        wire_file = Path(wire.source).absolute()
        notes = {"caveats": json.dumps(wire.caveats), WIRE_FILE: str(wire_file)}
        recording = record_session(log_file, open_rig, begun_with, **notes)
        log_files.append(log_file)
        found = assess(wire_file, config.feedback)
        output.warn(found.caveats)
        with health_recorded(log_file, output.warn), recording as recorder:
            session = TuningSession(
                open_rig, tuning, properties, references, channel, builder, view.tick, recorder, expected_of(wire)
            )
            if found.health is not None:
                session.note_health(found.health)
            with opened(page, open_rig, output, browser=browser and not as_json):
                output.result({"url": page.url, "pid": page.server.pid, "log_file": str(log_file)})
                use_real_time_scheduling()
                with watched(view, output), rig_use:  # frees the ports first: `smadrive off` waits for them
                    session.run()


def _publication(
    url: str | None, config: RigConfig, channel: DriverEnd, output: Output
) -> AbstractContextManager[Publication | None]:
    """Return the context in which the session is published, or an empty one without `--publish`."""
    return nullcontext() if url is None else open_publication(url, config, "tune", channel, output)


def _check(rig: Rig, wire: WireProperties, tuning: Tuning, output: Output) -> None:
    """Raise ConfigError if `wire` cannot be the wire of the rig, or the rig lacks the displacement source of `tuning`.

    Warnings about the source are printed. Each arming checks again whether the wire is cold.
    """
    rig.check_balance(wire.balance)
    cold_c = wire.balance.ambient_c
    output.warn(rig.check_sensing(wire.wire_model(tuning.model), tuning.displacement_from, cold_c))


@contextmanager
def _named_at_the_end(output: Output) -> Iterator[list[Path]]:
    """Yield a list of logs. At the end of the `with` block, print the path of each log that was written."""
    log_files: list[Path] = []
    try:
        yield log_files
    finally:
        with suppress(ConfigError, OSError):  # a failed print must not become an error of the session
            for path in log_files:
                if path.exists():
                    output.say(f"log: {path}")


def new_log_file(folder: Path) -> Path:
    """Return a path in `folder` for the log of a session that begins now. No file has this path."""
    make_folder(folder)
    name = f"tuning-{datetime.now(UTC):%Y%m%d-%H%M%S}"
    names = (f"{name}{'' if n == 1 else f'-{n}'}.h5" for n in count(1))
    return next(path for path in (folder / file for file in names) if not os.path.lexists(path))


def _references(given: list[str], wire: HysteresisModel, limits: LimitsConfig) -> dict[str, Reference]:
    travel = travel_mm(wire)
    references = {text: read_reference(text) for text in given}
    for one in references.values():
        one.check_within(travel)
        check_rig_limits(one.scored_mm, limits.displacement_min_mm, limits.displacement_max_mm)
    return references or {slow_sine_name(travel): slow_sine(travel, cycles=1.0)}
