"""The model builder process: it answers the build requests of the loop until its standard input ends."""

from __future__ import annotations

import sys
from typing import Any

from smadrive.errors import SmadriveError
from smadrive.stream.child import report_ready, run
from smadrive.tuning.builder.build import BuildFailure, BuildRequest, BuildResult, build
from smadrive.tuning.builder.packing import ModelCache, pack_result, unpack_request
from smadrive.tuning.link.message_socket import MessageSocket


def serve(parameters: dict[str, Any]) -> None:
    """Answer the build requests that arrive at `parameters["address"]`, until standard input ends."""
    cache = ModelCache()
    with MessageSocket(parameters["address"], listens=True) as link:
        report_ready()
        while not link.wait(sys.stdin.fileno()):
            message = link.received()
            if message is not None:
                number, content = message
                request = unpack_request(content, cache)
                link.send(number, pack_result(result_of(request, cache), request))


def result_of(request: BuildRequest, cache: ModelCache) -> BuildResult:
    """Return the result of a request. Every error becomes a BuildFailure, because each request needs a result."""
    try:
        built = build(request)
    except SmadriveError as error:
        return BuildFailure(str(error))
    except Exception as defect:  # noqa: BLE001
        return BuildFailure(f"the model builder failed: {defect!r}")
    cache.keep(built.tuning.model)
    return built


if __name__ == "__main__":
    run(serve)
