"""`smadrive calibrate`: offset and scale of a sensor from its readings at known values."""

from __future__ import annotations

import sys
from collections.abc import Iterator
from enum import StrEnum
from math import nan
from typing import Annotated, Any

import typer

from smadrive.cli.parsing.options import RigFile
from smadrive.cli.terminal.output import AsJson, Output
from smadrive.errors import ConfigError, DataError
from smadrive.files.number_text import parse_number, with_decimal_point
from smadrive.identification.calibration import CalibrationFit, CalibrationPoint, check_values_apart, fit_calibration
from smadrive.rig.calibration.description import descriptions, today
from smadrive.rig.calibration.reading import (
    QUANTITIES,
    CalibratedQuantity,
    check_measured,
    check_reading,
    read_steadily,
)
from smadrive.rig.calibration.rig_file import check_own_file, store_calibration
from smadrive.rig.config import load_rig, rig_file
from smadrive.rig.rig import Rig
from smadrive.wire.boiling_point import STANDARD_HPA, boiling_point_c
from smadrive.wire.cold_wire import calibration_caveats, limit_caveats


class CalibratedSensor(StrEnum):
    """The sensors that can be calibrated."""

    TEMPERATURE = "temperature"
    DISPLACEMENT = "displacement"

    @property
    def quantity(self) -> CalibratedQuantity:
        """The quantity that the sensor measures."""
        return QUANTITIES[self]


def main(
    rig: RigFile,
    sensor: Annotated[CalibratedSensor, typer.Argument(help="Sensor to calibrate.")],
    point: Annotated[
        list[str],
        typer.Option(
            "--point", "-p", help="Known value in °C or mm, `ice` or `boiling`. Give it once for each point, in order."
        ),
    ],
    duration_s: Annotated[float, typer.Option("--for", min=1.0, max=600.0, help="Seconds of readings per point.")] = 10,
    pressure_hpa: Annotated[
        float, typer.Option(min=500.0, max=1100.0, help="Air pressure at `boiling`.")
    ] = STANDARD_HPA,
    value_uncertainty: Annotated[
        float | None,
        typer.Option(min=1e-6, help="Standard uncertainty of the known values; by default 0.1 °C or 0.01 mm."),
    ] = None,
    as_json: AsJson = False,
) -> None:
    """Calibrate a sensor of RIG at known values, and write offset and scale into the rig file. The heater stays off."""
    output = Output(as_json)
    path = rig_file(rig)
    config = load_rig(rig)
    check_own_file(path)
    values = [_value(text, sensor, pressure_hpa) for text in point]
    uncertainty = sensor.quantity.value_uncertainty if value_uncertainty is None else value_uncertainty
    raw = config.calibration.model_copy(update={sensor.value: None})
    check_values_apart(values, uncertainty)
    closed_rig = Rig(config.model_copy(update={"calibration": raw}))
    check_measured(closed_rig, sensor)
    with closed_rig as open_rig:
        check_reading(open_rig, sensor)
        points = list(_points(open_rig, sensor, values, uncertainty, duration_s))
    fit = fit_calibration(points)
    section = _section(sensor, fit, points)
    store_calibration(path, sensor, section)
    _print(output, sensor, fit, points)
    output.say(f"{path}: {descriptions(load_rig(rig).calibration, today())[sensor]}")
    caveats = _caveats(sensor, fit, closed_rig.data_sheet.ambient_c, config.limits.temperature_max_c)
    output.warn(caveats)
    output.result(
        {
            "rig_file": str(path),
            "sensor": sensor.value,
            **section,
            "on": section["on"].isoformat(),
            "points": [one._asdict() for one in points],
            "residual": fit.residual,
            "caveats": caveats,
        }
    )


def _value(text: str, sensor: CalibratedSensor, pressure_hpa: float) -> float:
    """Return the known value of a point, in °C or mm.

    ConfigError if `text` is neither a number in the range of known values nor, for a temperature, `ice` or `boiling`.
    """
    named = {"ice": 0.0, "boiling": boiling_point_c(pressure_hpa)} if sensor is CalibratedSensor.TEMPERATURE else {}
    if text in named:
        return named[text]
    corrected = with_decimal_point(text)
    try:
        value = parse_number(text)
    except ValueError:
        value = nan
    low, high = sensor.quantity.known_values
    if not low <= value <= high:
        numbers = f"give a number of {sensor.quantity.unit}{', `ice` or `boiling`' if named else ''}"
        raise ConfigError(
            "the known value is not a number in the range",
            where="--point",
            value=text,
            limit=f"{low:g} to {high:g} {sensor.quantity.unit}",
            cure=numbers if corrected is None else f"write {corrected}",
        )
    return value


def _points(
    rig: Rig, sensor: CalibratedSensor, values: list[float], value_uncertainty: float, duration_s: float
) -> Iterator[CalibrationPoint]:
    """Yield a point for each value, after the user has brought the sensor to this value."""
    for value in values:
        _ask(f"Bring the {sensor} sensor to {value:.2f} {sensor.quantity.unit} and let it settle, then press Enter: ")
        reading = read_steadily(rig, sensor, duration_s)
        yield CalibrationPoint(value, reading.mean, value_uncertainty, reading.uncertainty)


def _ask(text: str) -> None:
    """Wait for Enter. DataError when the input has ended."""
    print(text, end="", file=sys.stderr, flush=True)
    if not sys.stdin.readline():
        print(file=sys.stderr)
        raise DataError(
            "the point was not confirmed",
            where="stdin",
            cure="run the command in a terminal, and press Enter at each point",
        )


def _section(sensor: CalibratedSensor, fit: CalibrationFit, points: list[CalibrationPoint]) -> dict[str, Any]:
    """Return the calibration section of this sensor for the rig file. The key `evidence` lists the points as text."""
    suffix = sensor.quantity.suffix
    values: dict[str, Any] = {
        f"offset_{suffix}": round(fit.offset, 5),
        f"offset_uncertainty_{suffix}": round(fit.offset_uncertainty, 5),
        "scale": round(fit.scale, 6),
    }
    if fit.scale_uncertainty is not None:
        values["scale_uncertainty"] = round(fit.scale_uncertainty, 6)
    values["on"] = today()
    values["evidence"] = "; ".join(
        f"{one.reading:.4g} read at {one.value:.4g} {sensor.quantity.unit}" for one in points
    )
    return values


def _caveats(sensor: CalibratedSensor, fit: CalibrationFit, ambient_c: float, limit_c: float) -> tuple[str, ...]:
    """Return the reasons to distrust a calibration, one sentence each."""
    only_offset = "one point determines only the offset; a second point would determine the scale, too"
    few = () if fit.scale_uncertainty is not None else (only_offset,)
    if sensor is not CalibratedSensor.TEMPERATURE:
        return few

    def correct(reading_c: float) -> float:
        return fit.scale * reading_c + fit.offset

    cold = calibration_caveats(correct(ambient_c), ambient_c)
    return (*few, *cold, *limit_caveats(correct, ambient_c, limit_c))


def _print(output: Output, sensor: CalibratedSensor, fit: CalibrationFit, points: list[CalibrationPoint]) -> None:
    unit = sensor.quantity.unit
    rows = [(f"{one.value:.3f}", f"{one.reading:.3f}", f"{fit.scale * one.reading + fit.offset:.3f}") for one in points]
    output.table((f"known value / {unit}", f"reading / {unit}", f"corrected / {unit}"), rows)
