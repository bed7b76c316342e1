"""A feed that is published, and the ticks that it gets."""

from smadrive.control.controllers.interface import Command
from smadrive.control.loop import Tick
from smadrive.measurement import Measurement
from smadrive.rig.config import load_rig
from smadrive.rig.rig import Rig
from smadrive.stream.published_state import PublishedMode
from smadrive.stream.shared_memory import SharedWriter
from smadrive.telemetry.address import parse_address
from smadrive.telemetry.feed import RunFeed
from smadrive.telemetry.publication import Publication

CONFIG = load_rig("in-process")


class Published:
    """A feed that is published to the broker at `url`, and the ticks that it gets."""

    def __init__(self, url, config=CONFIG):
        self.writer = SharedWriter()
        self.publication = Publication(parse_address(url, {}), config, "run", self.writer)
        self.feed = RunFeed(self.writer, config, PublishedMode.TRACKING)
        self.count = 0
        self.config = config

    def __enter__(self):
        self.writer.__enter__()
        self.publication.__enter__()
        self.feed.__enter__()
        return self

    def begin(self):
        with Rig(self.config) as rig:
            self.feed.begin(rig)
        return self

    def __exit__(self, *error):
        self.feed.__exit__(*error)
        self.publication.__exit__(*error)
        self.counts = self.publication.counts
        self.writer.__exit__(*error)

    def tick(self, ticks=1, **measured):
        for _ in range(ticks):
            time_s = 0.05 * self.count
            values = {"temperature_c": 20.0 + self.count, "current_a": 0.1, "voltage_v": 1.6, **measured}
            self.feed.tick(Tick(time_s, 0.0, Measurement(time_s, **values), Command(0.1)))
            self.count += 1
