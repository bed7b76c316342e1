"""The table of log columns agrees with the types of a tick."""

import subprocess
import sys
from math import nan
from operator import attrgetter

import pytest

from smadrive.control.controllers.interface import Command
from smadrive.control.loop import Tick
from smadrive.measurement import Measurement
from smadrive.runs.columns import COLUMNS, fields_of, row_getter

MEASUREMENT = Measurement(2.0, 84.0, 0.2, 3.1, 4.2, in_force_a=0.21)
TICK = Tick(1.9, 0.001, MEASUREMENT, Command(0.25, setpoint_c=85.0, setpoint_mm=4.3))


def test_row_holds_the_values_of_the_tick_in_the_order_of_the_names():
    names = ("time_s", "setpoint_mm", "commanded_a", "in_force_a", "late_s")
    assert row_getter(names)(TICK) == (1.9, 4.3, 0.25, 0.21, 0.001)


@pytest.mark.parametrize("name", COLUMNS)
def test_column_has_the_name_of_its_attribute(name):
    attribute = COLUMNS[name].source.rpartition(".")[2]
    assert attribute == {"limited": "limits"}.get(name, name)
    attrgetter(COLUMNS[name].source)(TICK)


@pytest.mark.parametrize(
    ("changes", "flags"),
    [
        ({}, (0.0, 0.0)),
        ({"temperature_fault": "open", "temperature_c": nan}, (1.0, 0.0)),
        ({"device_limits": ("voltage",)}, (0.0, 1.0)),
        ({"host_limits": ("current_max",)}, (0.0, 1.0)),
    ],
)
def test_flag_is_1_where_its_source_is_not_empty(changes, flags):
    tick = TICK._replace(measurement=MEASUREMENT._replace(**changes))
    assert row_getter(("temperature_fault", "limited"))(tick) == flags


def test_every_number_of_a_command_is_a_column():
    assert set(fields_of("command")) == set(Command._fields)


def test_labels_name_quantity_role_and_unit():
    column = COLUMNS["setpoint_c"]
    assert (column.label, column.axis_label) == ("temperature, setpoint", "temperature / °C")
    assert column.difference_unit == "K"
    assert COLUMNS["late_s"].label == "lateness of the tick"


def test_table_is_loaded_without_hdf5_and_plots():
    code = "import sys, smadrive.runs.columns; print({'h5py', 'matplotlib', 'pydantic'} & set(sys.modules))"
    done = subprocess.run([sys.executable, "-c", code], capture_output=True, text=True, check=True)
    assert done.stdout.strip() == "set()"
