"""Cards and line plots: well-formed, small, escaped, with gaps where values are missing."""

from math import inf, nan
from xml.etree import ElementTree as ET

import numpy as np
import pytest

import smadrive
from smadrive.control.references.shapes import sine
from smadrive.display.card import card
from smadrive.display.line_plot import POINTS, Curve, line_plot
from smadrive.hysteresis import DuhemModel
from smadrive.identification import identify_tsfuzzy
from smadrive.measurement import Measurement
from smadrive.wire.heat_balance import HeatBalance
from smadrive.wire.identified_wire import IdentifiedWire

MODEL = DuhemModel.gaussian(
    mu_heating=90, mu_cooling=69, sigma_heating=5, sigma_cooling=5, scale=12, input_range=(20, 140)
)
NAMESPACE = "{http://www.w3.org/2000/svg}"
SMALL_BYTES = 30_000


def elements(html, tag):
    """The elements of a well-formed fragment, whether they belong to SVG or to HTML."""
    return [one for one in ET.fromstring(html).iter() if one.tag.removeprefix(NAMESPACE) == tag]  # noqa: S314


def drawn(*values):
    """The path of a curve through the values."""
    plot = line_plot([Curve(range(len(values)), values, "measured", "#123456")], "time / s", "mm")
    return next(path.get("d") for path in elements(plot, "path") if path.get("fill") == "none")


def test_card_escapes_its_texts():
    html = card("<title>", [("a & b", "<i>")], warnings=["x < y"])
    assert [cell.text for cell in elements(html, "td")] == ["a & b", "<i>"]
    assert "<i>" not in html


@pytest.mark.parametrize("missing", [nan, inf])
def test_curve_has_a_gap_where_a_value_is_missing(missing):
    assert drawn(1.0, 2.0, missing, 3.0, 4.0).count("M") == 2
    assert drawn(1.0, 2.0, 3.0, 4.0).count("M") == 1


@pytest.mark.parametrize("values", [(2.0, 2.0), (0.0, 0.0), (1.0,), (-3e-9, -3e-9)])
def test_constant_curve_is_drawn(values):
    assert "nan" not in drawn(*values)


@pytest.mark.parametrize("values", [(), (nan, nan)])
def test_plot_without_values_is_empty(values):
    assert line_plot([Curve(range(len(values)), values, "none", "red")], "x", "y") == ""


def test_long_curve_keeps_its_spikes():
    values = np.zeros(100_000)
    values[77_777] = 5.0
    path = drawn(*values)
    assert path.count("L") <= 2 * POINTS
    heights = [float(part.split()[1]) for part in path.replace("M", "L").split("L") if part]
    assert heights.count(min(heights)) == 1


@pytest.mark.parametrize(
    "shown",
    [
        MODEL,
        IdentifiedWire(MODEL, caveats=("coarse & noisy",), source="/somewhere/excitation.h5"),
        sine(low_mm=2, high_mm=9, period_s=56),
        Measurement(0.0, 21.8, 0.0, 0.0, device_faults=("watchdog",)),
    ],
    ids=lambda shown: type(shown).__name__,
)
def test_every_object_has_a_small_well_formed_card(shown):
    html = shown._repr_html_()
    assert elements(html, "div")
    assert len(html) < SMALL_BYTES
    assert "somewhere" not in html


@pytest.mark.exhaustive
def test_reprs_name_what_a_person_asks_first():
    temperature = np.concatenate([np.linspace(a, b, 200) for a, b in ((20, 130), (130, 20), (20, 95), (95, 20))])
    fit = identify_tsfuzzy(temperature, MODEL.simulate(temperature))
    assert repr(fit).startswith("Fit(0.")
    assert "certified" in repr(fit)
    assert repr(fit.model).startswith("TSFuzzyDuhem(rules 22, input 20 to 130")
    assert repr(MODEL) == "DuhemModel(input 20 to 140, output 0 to 12, certified yes)"
    assert "stroke 12 mm" in repr(IdentifiedWire(MODEL))
    assert repr(sine(low_mm=2, high_mm=9, period_s=56)) == "Reference(112 s, 2 to 9 mm)"


def test_measurement_names_invalid_values_by_their_reason():
    broken = Measurement(
        0.0, nan, nan, nan, temperature_fault="open", supply_fault="no reply", host_limits=("current",)
    )
    text = repr(broken)
    assert "temperature open" in text
    assert "current no reply" in text
    assert "displacement -" in text
    assert "limited by current" in text


@pytest.mark.exhaustive
def test_text_of_every_public_object_is_ascii(tmp_path):
    balance = HeatBalance(0.0298, 0.014, 0.83, 22.0, 16.5, -0.12, 0.15)
    broken = Measurement(0.0, 21.5, nan, nan, supply_fault="größer als 1 Ω")
    wire = IdentifiedWire(MODEL, balance, caveats=("temperature ≥ 20 °C – 5 µm",), source="Drähte.csv")
    with smadrive.open_rig("in-process") as rig:
        run = rig.heat(0.5, current_a=0.1, log=tmp_path / "Drähte.h5")
        closed = [repr(rig), repr(run), repr(run.log)]
    for text in (*closed, *map(str, (MODEL, wire, wire.heat_balance, broken, sine(low_mm=2, high_mm=9, period_s=56)))):
        assert text.isascii()
    assert "temperature 21.50 deg C" in repr(broken)
