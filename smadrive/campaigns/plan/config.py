"""The campaign file: the settings of its runs, the axes, references, disturbances, and the report.

    title = "Tracking error over noise and wires"
    seed = 1
    [run]                                   # the settings of every run
    reference = "slow sine"
    [[vary]]                                # an axis; several lists in it would vary together
    sim.thermocouple.noise_c = [0.05, 0.1, 0.2]
    [[vary]]                                # another axis
    random_wires = 50
    [references."slow sine"]
    shape = "sine:period_s=56"

The campaign has a run for each combination of the values of all axes.
"""

from __future__ import annotations

from pathlib import Path
from typing import Any, Literal, Self

from pydantic import ConfigDict, Field, model_validator

from firmware_sim.config import HysteresisKind
from smadrive.errors import ConfigError
from smadrive.files.config import Section, load_config
from smadrive.files.kinds import CAMPAIGN
from smadrive.files.shipped import config_file
from smadrive.identification.wire import FitSettings, Kind
from smadrive.runs.record_fit import INPUT, OUTPUT

Experiment = Literal["track", "identify", "fit"]
ControllerName = Literal["inverse", "duhem-inverse", "plain-map", "feedback-only"]

NO_DISTURBANCE = "none"
"""The name of a disturbance that does nothing."""

MAIN_METRICS: dict[Experiment, str] = {"track": "rms_percent", "identify": "fit_rms_percent", "fit": "fit_rms_percent"}
"""The metric that the report shows, unless the file names another one."""


class WireSettings(Section):
    """The simulated wire.

    diameter_mm   take a Flexinol wire of this diameter from published data, in place of the wire of the sim file; its
                  data sheet replaces the wire file of the rig
    length_m      length of the Flexinol wire; needs `diameter_mm`
    alloy         alloy of the Flexinol wire: low (LT) or high (HT) transformation temperature; needs `diameter_mm`
    seed          vary the parameters of the wire at random, with this seed
    kind          kind of hysteresis of a random wire; by default random; needs `seed`
    """

    diameter_mm: float | None = Field(default=None, ge=0.01, le=10)
    length_m: float = Field(default=0.3, ge=0.002, le=100)
    alloy: Literal["LT", "HT"] = "LT"
    seed: int | None = Field(default=None, ge=0)
    kind: HysteresisKind | None = None


class FitConfig(Section):
    """The kind of model to identify, and its size. `input` and `output` are the columns of a CSV record."""

    kind: Kind = "tsfuzzy"
    sets: int | None = None
    memory: int | None = None
    components: int | None = None
    input: str = INPUT
    output: str = OUTPUT

    @model_validator(mode="after")
    def _check_settings(self) -> Self:
        try:
            self.settings()
        except ConfigError as error:
            raise ValueError(str(error)) from None
        return self

    def settings(self) -> FitSettings:
        """Return the settings of the identification."""
        return FitSettings.of(self.kind, self.sets, self.memory, self.components)


class RunSettings(Section):
    """The settings of one run.

    experiment            track: excite, identify and track; identify: excite and identify; fit: fit a record
    rig, sim              `file` names the rig file or the sim file; each other key replaces this key of the file.
                          [run.rig.devices.NAME] replaces keys of the device NAME
    wire, fit             see WireSettings and FitConfig
    model                 a model file: track with this wire model, without excitation
    record                a log or a CSV file, for the experiment `fit`
    controller            inverse; duhem-inverse; plain-map; feedback-only
    reference             a name under [references]
    disturbance           a name under [disturbances], or none
    displacement_sensor   False: the tracking run has no displacement sensor; the excitation always has one
    seed                  seed of the sensors' noise; by default the seed of the campaign
    """

    experiment: Experiment = "track"
    rig: dict[str, Any] = Field(default_factory=dict)
    sim: dict[str, Any] = Field(default_factory=dict)
    wire: WireSettings = WireSettings()
    fit: FitConfig = FitConfig()
    model: str | None = None
    record: str | None = None
    controller: ControllerName = "inverse"
    reference: str | None = None
    disturbance: str = NO_DISTURBANCE
    displacement_sensor: bool = True
    seed: int | None = Field(default=None, ge=0)


class AxisConfig(Section):
    """An axis: a table of [[vary]].

    name           name of the column in the table of results; by default the first path
    labels         texts for the values; needed if a value is a list or a table
    random_wires   this number of random wires; the first has the seed of the campaign, the next one this seed + 1, ...
    repeats        this number of runs that differ only in their noise; its seeds count up in the same way
    records        a pattern of file names, such as "reel/*.h5"; one run per file

    Each other key is the path of a setting of `[run]`. Its value is a list of values, or a grid (see `GridConfig`) such
    as {low = 0.1, high = 0.4, number = 7}.
    """

    model_config = ConfigDict(extra="allow")

    name: str | None = None
    labels: tuple[str, ...] | None = None
    random_wires: int | None = Field(default=None, ge=1)
    repeats: int | None = Field(default=None, ge=1)
    records: str | None = None


class GridConfig(Section):
    """`number` values from `low` to `high`, in place of a list of values."""

    low: float = Field(ge=-1e300, le=1e300)
    high: float = Field(ge=-1e300, le=1e300)
    number: int = Field(ge=2)
    spacing: Literal["linear", "logarithmic"] = "linear"

    @model_validator(mode="after")
    def _is_possible(self) -> Self:
        if self.low == self.high:
            raise ValueError(f"low and high are equal ({self.low:g}): write two different ends")
        if self.low > self.high:
            raise ValueError(f"low = {self.low:g} is above high = {self.high:g}: exchange the two")
        if self.spacing == "logarithmic" and not (self.low > 0 and self.high > 0):
            raise ValueError("a logarithmic grid needs ends above 0")
        return self


class ReferenceConfig(Section):
    """A displacement reference: a shape, or a CSV file with `time_s` and `displacement_mm` or `phase`.

    A shape without `low_mm` and `high_mm` moves between the shares `low` and `high` of the identified travel. `phase`
    is a share of this travel, too. With `smooth`, the run tracks the nearest reference that the wire can follow,
    otherwise the reference as it is.
    """

    shape: str | None = None
    file: str | None = None
    low: float = Field(default=0.2, ge=0, le=1)
    high: float = Field(default=0.8, ge=0, le=1)
    smooth: bool = True

    @property
    def is_scaled(self) -> bool:
        """True if the reference is a shape that moves between `low` and `high`."""
        return self.shape is not None and "_mm=" not in self.shape.replace(" ", "")

    @model_validator(mode="after")
    def _one_source(self) -> Self:
        if (self.shape is None) == (self.file is None):
            raise ValueError('a reference needs either shape = "sine:period_s=56" or file = "FILE.csv"')
        unused = sorted({"low", "high"} & self.model_fields_set)
        if unused and not self.is_scaled:
            whose = "file" if self.shape is None else "shape"
            raise ValueError(f"{' and '.join(unused)} has no effect, because the {whose} has its own range: remove it")
        if self.low == self.high:
            raise ValueError(f"low and high are equal ({self.low:g}): write two different shares of the travel")
        return self


class DisturbanceConfig(Section):
    """A fault or a change of the simulated bench. Each other key is a parameter of the fault.

    The fault begins at the time `at_s`, or at a random time in the range `between_s`. Both count from the end of the
    approach.
    """

    model_config = ConfigDict(extra="allow")

    name: str
    at_s: float | None = Field(default=None, ge=0)
    between_s: tuple[float, float] | None = None

    @property
    def latest_s(self) -> float:
        """The latest time at which the fault may begin, s."""
        latest_s = self.at_s if self.between_s is None else self.between_s[1]
        assert latest_s is not None
        return latest_s

    @model_validator(mode="after")
    def _one_time(self) -> Self:
        if (self.at_s is None) == (self.between_s is None):
            raise ValueError(f"'{self.name}' needs either at_s = 10.0 or between_s = [5.0, 60.0]")
        if self.between_s is not None and not 0.0 <= self.between_s[0] < self.between_s[1]:
            limit = f"[first, last] with 0 <= first < last (it is {list(self.between_s)})"
            raise ValueError(f"between_s of '{self.name}' must be {limit}")
        return self


class ReportConfig(Section):
    """The content of the report.

    metric       column that is ranked and summarized; by default `rms_percent`, without tracking `fit_rms_percent`
    by           columns by which the summary groups the runs; by default all axes except random wires and repeats
    worst_logs   number of worst tracking runs that are executed again to write their logs
    """

    metric: str | None = None
    by: tuple[str, ...] | None = None
    worst_logs: int = Field(default=5, ge=0, le=100)


class CampaignConfig(Section):
    """The content of a campaign file."""

    title: str
    seed: int = Field(default=0, ge=0, le=2**32 - 1)
    run: RunSettings = RunSettings()
    vary: tuple[AxisConfig, ...] = ()
    references: dict[str, ReferenceConfig] = Field(default_factory=dict)
    disturbances: dict[str, tuple[DisturbanceConfig, ...]] = Field(default_factory=dict)
    report: ReportConfig = ReportConfig()

    @model_validator(mode="after")
    def _keeps_none(self) -> Self:
        if NO_DISTURBANCE in self.disturbances:
            raise ValueError(f"a disturbance called '{NO_DISTURBANCE}' does nothing: choose another name")
        return self


def load_campaign(name: str | Path) -> CampaignConfig:
    """Load a campaign file. `name` is a path or the name of a shipped file. ConfigError names file, key and cure."""
    return load_config(config_file(name, CAMPAIGN), CampaignConfig)
