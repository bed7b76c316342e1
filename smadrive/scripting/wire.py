"""Identification in a script: from a run, a file, a table or two arrays to an identified wire with a plot."""

from __future__ import annotations

import os
from dataclasses import dataclass
from pathlib import Path
from typing import TYPE_CHECKING, Any

import numpy as np

from smadrive.errors import ConfigError
from smadrive.files.atomic import check_output
from smadrive.files.kinds import MODEL
from smadrive.identification.wire import AnyFit, FitSettings, Kind
from smadrive.numerics.arrays import paired_vectors
from smadrive.rig.config import FeedbackConfig
from smadrive.runs.health.assessment import assess, wire_file_of
from smadrive.runs.record_fit import (
    INPUT,
    OUTPUT,
    RecordFit,
    check_log_columns,
    check_table_columns,
    fit_columns,
    fit_file,
    fit_log,
)
from smadrive.scripting.arguments import path_text
from smadrive.scripting.run import Run
from smadrive.wire.health.drift import WireHealth
from smadrive.wire.identified_wire import IdentifiedWire
from smadrive.wire.identified_wire import load_wire as load_wire_file

if TYPE_CHECKING:
    from smadrive.runs.plot_style import PlotFigure


@dataclass(frozen=True, repr=False)
class Wire(IdentifiedWire):
    """An identified wire with a plot. `fit` is the fit of this script; a wire from a file has none.

    wire = smadrive.identify(run)
    wire.fit.rms_percent, wire.model, wire.heat_balance
    wire.save("wire.json")
    print(smadrive.load_wire("wire.json").health)
    """

    _fit: AnyFit | None = None
    axes: tuple[str, str] = ("wire temperature / °C", "displacement / mm")

    @property
    def fit(self) -> AnyFit:
        """The fit: its errors and certificate. ConfigError for a wire from a file, which holds only the model."""
        if self._fit is None:
            cure = "identify its record again, with smadrive.identify; the model of the file is wire.model"
            raise ConfigError("a wire from a file has no fit", where=self.source or "wire", cure=cure)
        return self._fit

    def plot(self) -> PlotFigure:
        """Return a matplotlib figure of the loop. It shows record and model; for a loaded wire, only the model."""
        from smadrive.runs.figures.fit_plots import loop_figure, model_figure  # noqa: PLC0415 (matplotlib takes 0.5 s)

        return model_figure(self.model) if self._fit is None else loop_figure(self._fit, self.axes)

    @property
    def health(self) -> WireHealth | None:
        """The drift of the wire since its identification, from the health record beside its model file.

        The drift counts as large or small for a rig with the default `[feedback]`.
        None for a wire that was not loaded from a file, and for a file without a health record.
        """
        wire_file = wire_file_of(self)
        return None if wire_file is None else assess(wire_file, FeedbackConfig()).health

    def save(self, path: str | os.PathLike[str]) -> None:
        """Write the wire to a file (.json), with the time of writing. DataError when the file cannot be written."""
        file = Path(path_text(path, "path", "the path of a model file"))
        check_output(file, MODEL)
        super().save(file)


def identify(
    data: Any,
    displacement_mm: Any = None,
    *,
    kind: Kind = "tsfuzzy",
    sets: int | None = None,
    memory: int | None = None,
    components: int | None = None,
    input: str = INPUT,  # noqa: A002 (as the option of the command is called)
    output: str = OUTPUT,
) -> Wire:
    """Fit a hysteresis model to a record and, for the log of an excitation, also the heat balance of the wire.

        wire = smadrive.identify(rig.excite())                        a run of this script
        wire = smadrive.identify("excitation.h5")                     a log, or a CSV file
        wire = smadrive.identify(frame)                               columns temperature_c and displacement_mm
        wire = smadrive.identify(temperature_c, displacement_mm)      two arrays

    A table is any object with columns by name, such as a DataFrame, a dict or an xarray.Dataset.

    kind            "tsfuzzy" or "duhem"
    sets            number of fuzzy sets of a T-S fuzzy model, 3 to 50; by default 11
    memory          sets of the last turning point of a T-S fuzzy model, 4 to 40, or 1 for no memory; by default the
                    errors on loops that are held out of the fit decide
    components      number of Gaussians per branch of a Duhem model, 1 to 6; by default 2
    input, output   names of the columns of a CSV file or a table

    ConfigError for an option that the kind or the record does not have. DataError for a record that cannot be used,
    IdentificationError for a record that does not determine the model.
    """
    settings = FitSettings.of(kind, sets, memory, components)
    _check_columns(input, output)
    record, source = _fitted(data, displacement_mm, (input, output), settings)
    wire = record.wire(source)
    axes = ("wire temperature / °C", "displacement / mm") if record.thermal is not None else record.axes
    return Wire(**vars(wire), _fit=record.fit, axes=axes)


def load_wire(path: str | os.PathLike[str]) -> Wire:
    """Load a wire from a file (.json) of `smadrive identify` or `Wire.save`.

    ModelError for a malformed file, CertificateError for an uncertified model.

    wire = smadrive.load_wire("wire.json")
    """
    wire = load_wire_file(path_text(path, "path", "the path of a model file"))
    return Wire(**vars(wire))


def _check_columns(*columns: object) -> None:
    for where, name in zip(("input", "output"), columns, strict=True):
        if not isinstance(name, str):
            cure = "pass the name of a column"
            raise ConfigError("of the wrong type", where=where, value=type(name).__qualname__, cure=cure)


def _fitted(data: Any, displacement_mm: Any, columns: tuple[str, str], settings: FitSettings) -> tuple[RecordFit, str]:
    """Return the fit and the path of its record. The path is "" for arrays and for a table."""
    if displacement_mm is not None:
        v, y = paired_vectors(data, displacement_mm, ("temperature_c", "displacement_mm"))
        return fit_columns(v, y, columns, settings), ""
    if isinstance(data, Run):
        check_log_columns(data.log_file, columns)
        return fit_log(data.log, settings), str(data.log_file)
    if isinstance(data, str | os.PathLike):
        return fit_file(Path(data), columns, settings), str(data)
    if hasattr(data, "keys") and hasattr(data, "__getitem__"):
        # keys() are the columns of a DataFrame, a dict and a Dataset; the coordinates of a Dataset are not among them
        check_table_columns("data", columns, map(str, (*data.keys(), *getattr(data, "coords", ()))))
        v, y = paired_vectors(np.asarray(data[columns[0]]), np.asarray(data[columns[1]]), columns)
        return fit_columns(v, y, columns, settings), ""
    cure = "pass a run, the path of a log or CSV file, a table with columns by name, or two arrays"
    raise ConfigError("no record", where="data", value=type(data).__qualname__, cure=cure)
