"""The large numbers show the newest sample and its state, and the error axis follows the visible errors."""

from math import nan

import numpy as np
import pytest

from smadrive.display.colours import PAGE_ESTIMATED, PAGE_MEASURED, PAGE_SETPOINT
from smadrive.stream.samples import COLUMNS
from smadrive.tuning.page.view.error_axis import LEAST_PERCENT, error_axis
from smadrive.tuning.page.view.live_numbers import NONE, OLD_S, LiveNumbers, measured_numbers, tracking_numbers
from smadrive.tuning.page.view.plots import Plots
from tests.unit.tuning.conftest import true_wire

MEASURED_ROW = {
    "time_s": 5.0,
    "temperature_c": 90.26,
    "displacement_mm": 6.534,
    "current_a": 0.2581,
    "setpoint_c": 90.5,
    "setpoint_mm": 6.512,
    "estimated_c": 90.4,
    "estimated_mm": 6.6,
    "commanded_a": 0.2,
}


def rows(*changed, **values):
    """Return a row for each dictionary of changed values; without one, a single row."""
    made = [{**MEASURED_ROW, **values, **change} for change in (changed or ({},))]
    return np.array([[row.get(name, 0.0) for name in COLUMNS] for row in made])


def test_measured_values_are_shown_with_their_setpoints():
    temperature, displacement, current, error = tracking_numbers(rows()[0], stroke_mm=12.0)
    assert temperature == ("90.3", "measured", "setpoint\n90.5 °C")
    assert displacement == ("6.53", "measured", "setpoint\n6.51 mm")
    assert current == ("0.258", "measured", "commanded\n0.200 A")
    assert error == ("−0.02", "measured", "−0.2 %\nof stroke")


def test_missing_values_are_estimated_and_the_error_too():
    temperature, displacement, current, error = tracking_numbers(
        rows(temperature_c=nan, displacement_mm=nan, current_a=nan)[0], stroke_mm=12.0
    )
    assert temperature[:2] == ("90.4", "estimated")
    assert displacement[:2] == ("6.60", "estimated")
    assert current[:2] == ("0.200", "commanded")
    assert error[:2] == ("−0.09", "estimated")


def test_cold_wire_has_no_setpoint_and_no_error():
    unheated = dict.fromkeys(("setpoint_c", "setpoint_mm", "estimated_c", "estimated_mm"), nan)
    temperature, displacement, _, error = tracking_numbers(rows(**unheated, displacement_mm=nan)[0], stroke_mm=12.0)
    assert temperature == ("90.3", "measured", "")
    assert displacement == (NONE, "unknown", "")
    assert error == (NONE, "no setpoint", "")


@pytest.mark.parametrize(
    ("mm", "text"), [(-0.001, "0.00"), (-12.344, "−12.34"), (123.456, "123.5"), (12345.6, "12346")]
)
def test_number_fits_into_its_place(mm, text):
    assert tracking_numbers(rows(displacement_mm=mm)[0], stroke_mm=12.0)[1].value == text


def test_old_sample_is_not_shown_as_the_present_one():
    now_s = 100.0
    numbers = LiveNumbers(0.05, measured_numbers, lambda: now_s)
    none, one = rows()[:0], rows()
    numbers.update(none)
    assert {value for value, *_ in numbers.model.texts} == {NONE}
    numbers.update(one)
    now_s += 0.9 * OLD_S
    numbers.update(none)
    assert numbers.model.texts[0][0] == "90.3"
    now_s += 0.2 * OLD_S
    numbers.update(none)
    assert {(value, state) for value, state, _ in numbers.model.texts} == {(NONE, "no sample")}


def test_slow_loop_is_not_called_silent_between_two_samples():
    now_s = 0.0
    numbers = LiveNumbers(1.0, measured_numbers, lambda: now_s)
    numbers.update(rows())
    now_s = 2.0
    numbers.update(rows()[:0])
    assert numbers.model.texts[0][0] == "90.3"


def test_noise_does_not_fill_the_error_axis():
    low, high = error_axis(np.array([-0.3, 0.3]), (-100.0, 100.0))
    assert high - low >= LEAST_PERCENT
    assert low < -0.3
    assert high > 0.3


@pytest.mark.parametrize(("low", "high"), [(-0.4, 14.0), (-31.0, 2.0), (3.0, 3.4), (-0.2, 0.9), (-180.0, 140.0)])
def test_error_axis_holds_all_errors_and_zero_and_is_not_much_longer(low, high):
    ends = error_axis(np.array([low, nan, high]), (-1e6, 1e6))
    assert ends[0] <= min(low, 0.0) < max(high, 0.0) <= ends[1]
    assert ends[1] - ends[0] <= max(1.4 * (max(high, 0.0) - min(low, 0.0)), 1.2 * LEAST_PERCENT)


def test_error_axis_stays_while_the_errors_change_little():
    ends = error_axis(np.array([-1.0, 5.0]), (-1.0, 1.0))
    assert error_axis(np.array([-1.0, 4.0]), ends) == ends
    assert error_axis(np.array([-0.2, 0.3]), ends) != ends


@pytest.fixture
def plots():
    plots = Plots(0.6, 135.0)
    plots.show_model(true_wire(), (0.0, 12.0))
    return plots


def test_error_axis_follows_the_errors_in_the_window_alone(plots):
    """The jump of 6 mm at 10 s is half of the stroke."""
    history = [{"time_s": float(t), "displacement_mm": 0.512 if t == 10 else 6.512} for t in range(120)]
    plots.show_rows(rows(*history), (0.0, 60.0))
    assert plots._error_range.end > 50.0
    plots.show_rows(rows(*history), (20.0, 80.0))
    assert plots._error_range.end < 2.0
    plots.show_rows(rows(*history), (5.0, 15.0))
    assert plots._error_range.end > 50.0
    plots.add(rows({"time_s": 120.0}))
    assert plots._error_range.end < 2.0


def test_turning_points_are_marked_on_the_loop_of_the_model(plots):
    model = true_wire()
    plots.show_turning_points([20.0, 95.0, 70.0])
    marked = plots._turning_points.data
    assert list(marked["v"]) == [20.0, 95.0, 70.0]
    assert marked["y"] == pytest.approx(model.simulate([20.0, 95.0, 70.0]))
    plots.show_model(model, (0.0, 12.0))
    assert not len(plots._turning_points.data["v"])


def test_setpoint_and_measured_are_drawn_above_estimated(plots):
    for name in ("displacement", "temperature"):
        plot = next(figure for figure in plots.figures if figure.name == name)
        assert [line.glyph.line_color for line in plot.renderers] == [PAGE_ESTIMATED, PAGE_MEASURED, PAGE_SETPOINT]
        widths = [line.glyph.line_width for line in plot.renderers]
        assert widths == sorted(widths, reverse=True)
