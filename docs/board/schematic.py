"""Draws schematic.svg, the circuit of the board in docs/board.md.

    python docs/board/schematic.py

Needs schemdraw. Wires with the same name are connected. The values are those of the range 1 A.
"""

from itertools import pairwise
from pathlib import Path

import schemdraw
import schemdraw.elements as elm
from schemdraw.elements import IcPin

FILE = Path(__file__).with_name("schematic.svg")

NANO_LEFT = ("A4", "A5", "A0", "D3", "D4", "D5")
NANO_RIGHT = ("D2", "D10", "D11", "D12", "D13")
NETS = {
    "A4": "SDA",
    "A5": "SCL",
    "A0": "DISP",
    "D3": "ESTOP",
    "D4": "EN",
    "D5": "JUMPER",
    "D2": "DRDY",
    "D10": "CS",
    "D11": "SDI",
    "D12": "SDO",
    "D13": "SCK",
}


CONVERTER_NETS = ("DRDY", "CS", "SDI", "SDO", "SCK")
BUS_NETS = (*CONVERTER_NETS, "SDA", "SCL")


def pins(side, names):
    """The pins of one side of a chip, from top to bottom."""
    count = len(names)
    return [IcPin(name=name, side=side, slot=f"{count - at}/{count}") for at, name in enumerate(names)]


def net(drawing, at, name, theta):
    """A short wire with the name of its net."""
    drawing.add(elm.Line().at(at).theta(theta).length(0.5))
    drawing.add(elm.Tag(width=1.5).theta(theta).label(name, fontsize=9))


def chip(drawing, at, label, left, right, size, spacing=0.9):
    """A chip with the corner at the lower left at `at`."""
    sides = [*pins("L", left), *pins("R", right)]
    part = elm.Ic(pins=sides, size=size, pinspacing=spacing).theta(0).at(at)
    drawn = drawing.add(part.label(label, "top", fontsize=11))
    for name in left:
        if name in BUS_NETS:
            net(drawing, getattr(drawn, name), name, 180)
    return drawn


def part(drawing, element, at, direction, length, label, side="top"):
    """A part with two terminals, with its label. Returns its end."""
    drawn = getattr(element.at(at), direction)(length).label(label, side, fontsize=9)
    return drawing.add(drawn).end


def dot(drawing, at):
    """A junction."""
    drawing.add(elm.Dot().at(at))


def line(drawing, *points):
    """A wire through the points."""
    for start, end in pairwise(points):
        drawing.add(elm.Line().at(start).to(end))


def ground(drawing, at):
    """A ground symbol."""
    drawing.add(elm.Ground().theta(0).at(at))


def supply(drawing, at, name):
    """A supply symbol."""
    drawing.add(elm.Vdd().theta(0).at(at).label(name, fontsize=9))


def nano(drawing):
    """The Arduino Nano."""
    drawn = chip(drawing, (0, 0), "U1 Arduino Nano\nATmega328P", NANO_LEFT, NANO_RIGHT, (3.6, 5.6))
    for name in NANO_LEFT:
        net(drawing, getattr(drawn, name), NETS[name], 180)
    for name in NANO_RIGHT:
        net(drawing, getattr(drawn, name), NETS[name], 0)


def converter(drawing):
    """The thermocouple converter, the bead, and the resistor that makes an open thermocouple read high."""
    drawn = chip(drawing, (9.4, 0.4), "U2 MAX31856\nbreakout, 3.3 V", CONVERTER_NETS, ("T+", "T-"), (2.8, 4.8))
    plus, minus = drawn["T+"], drawn["T-"]
    node = (plus[0] + 1.0, plus[1])
    bead = (plus[0] + 3.0, (plus[1] + minus[1]) / 2)
    line(drawing, plus, (bead[0] - 0.4, plus[1]), bead, (bead[0] - 0.4, minus[1]), minus)
    dot(drawing, node)
    supply(drawing, part(drawing, elm.Resistor(), node, "up", 2.0, "R1 10 MΩ", "bottom"), "3.3 V")
    drawing.add(elm.Dot(radius=0.14).at(bead).label("type K, bead\ninsulated from\nthe wire", "right", fontsize=9))


def inputs(drawing):
    """Emergency stop, jumper, pull-up and pull-down resistors, divider of the displacement."""
    rows = (
        ((0.5, -2.6), "ESTOP", elm.Button(nc=True), "S1 emergency stop, pole 1", None),
        ((0.5, -4.4), "JUMPER", elm.Switch(), "J1 displacement fitted", None),
        ((0.5, -6.2), "EN", elm.Resistor(), "R3 10 kΩ", None),
        ((7.0, -2.6), "SDA", elm.Resistor(), "R4 2.2 kΩ", "5V_A"),
        ((7.0, -4.4), "SCL", elm.Resistor(), "R5 2.2 kΩ", "5V_A"),
        ((13.0, -2.6), "SDO", elm.Resistor(), "R2 10 kΩ", "3.3 V"),
    )
    for at, name, element, label, level in rows:
        net(drawing, at, name, 180)
        end = part(drawing, element, at, "right", 1.8, label)
        if level is None:
            ground(drawing, end)
        else:
            supply(drawing, end, level)
    at = (13.0, -4.4)
    net(drawing, at, "DISP", 180)
    dot(drawing, at)
    end = part(drawing, elm.Resistor(), at, "right", 2.0, "R6 39 kΩ")
    drawing.add(elm.Dot(open=True).at(end).label("sensor 0 to 5 V", "right", fontsize=9))
    ground(drawing, part(drawing, elm.Resistor(), at, "down", 1.6, "R7 10 kΩ", "bottom"))


def sink(drawing):
    """The current sink: DAC, divider, op-amp, enable switch, MOSFET. Returns drain and source resistor's top."""
    dac = chip(drawing, (0, -20.0), "U3 MCP4725\nVDD = 5V_A", ("SDA", "SCL"), ("OUT",), (2.4, 2.2))
    divided = part(drawing, elm.Resistor(), dac.OUT, "right", 2.2, "R8 82 kΩ")
    dot(drawing, divided)
    ground(drawing, part(drawing, elm.Resistor(), divided, "down", 2.0, "R9 10 kΩ", "top"))
    plus = (divided[0] + 1.4, divided[1])
    line(drawing, divided, plus)
    amp = drawing.add(elm.Opamp().theta(0).flip().at(plus).anchor("in2").label("U4\nMCP6022", "center", fontsize=8))
    opened = part(drawing, elm.Switch(), amp.out, "right", 2.0, "U5 74HC4066")
    drawing.add(elm.Label().at((amp.out[0] + 1.0, amp.out[1] - 0.6)).label("closed by EN", fontsize=9))
    gate = part(drawing, elm.Resistor(), opened, "right", 1.8, "R10 100 Ω")
    dot(drawing, gate)
    ground(drawing, part(drawing, elm.Resistor(), gate, "down", 1.8, "R11 10 kΩ", "bottom"))
    line(drawing, gate, (gate[0] + 1.6, gate[1]))
    fet = drawing.add(elm.NFet().theta(0).reverse().at((gate[0] + 1.6, gate[1])).anchor("gate"))
    drawing.add(elm.Label().at((fet.drain[0] + 1.3, gate[1])).label("Q1 IRLZ44N", fontsize=9))
    sense = (fet.source[0], fet.source[1] - 1.4)
    line(drawing, fet.source, sense)
    dot(drawing, sense)
    ground(drawing, part(drawing, elm.Resistor(), sense, "down", 2.0, "R13 0.5 Ω 2 W", "bottom"))
    back = (sense[0] - 3.4, sense[1] - 2.6)
    line(drawing, sense, (sense[0] - 0.9, sense[1]), (sense[0] - 0.9, back[1]))
    end = part(drawing, elm.Resistor(), (sense[0] - 0.9, back[1]), "left", 2.5, "R12 1 kΩ", "bottom")
    line(drawing, end, (amp.in1[0] - 0.5, back[1]), (amp.in1[0] - 0.5, amp.in1[1]), amp.in1)
    below = amp.in1[1] - 1.1
    line(drawing, amp.out, (amp.out[0], below))
    end = part(drawing, elm.Capacitor(), (amp.out[0], below), "left", 2.0, "C1 1 nF", "bottom")
    line(drawing, end, (amp.in1[0] - 0.5, below))
    for at in (amp.out, (amp.in1[0] - 0.5, below)):
        dot(drawing, at)
    return fet.drain


def meters(drawing, drain):
    """The wire, its supply, and the two meters."""
    x = drain[0]
    low, top, high = (x, -14.6), (x, -12.0), (x, -9.4)
    line(drawing, drain, low)
    for at in (low, top, high):
        dot(drawing, at)
    part(drawing, elm.Resistor(), low, "up", 2.6, "SMA wire", "bottom")
    part(drawing, elm.Resistor(), top, "up", 2.6, "R14 0.05 Ω 1 %", "bottom")
    supply(drawing, part(drawing, elm.Fuse(), high, "up", 1.8, "F1 2 A", "bottom"), "V+ through pole 2 of S1")
    upper = chip(
        drawing, (x - 8.0, -12.9), "U6 INA226\naddress 0x40", ("SDA", "SCL"), ("IN+", "IN-", "VBUS"), (2.6, 3.2)
    )
    line(drawing, upper["IN+"], (x - 2.0, upper["IN+"][1]), (x - 2.0, high[1]), high)
    line(drawing, upper["IN-"], (x - 2.0, upper["IN-"][1]), (x - 2.0, top[1]), top)
    line(drawing, upper.VBUS, (x - 2.4, upper.VBUS[1]), (x - 2.4, upper["IN-"][1]))
    dot(drawing, (x - 2.4, upper["IN-"][1]))
    lower = chip(drawing, (x - 8.0, -16.6), "U7 INA226\naddress 0x41", ("SDA", "SCL"), ("VBUS",), (2.6, 2.0))
    line(drawing, lower.VBUS, (x - 3.0, lower.VBUS[1]), (x - 3.0, low[1]), low)
    text = "U8 LP2950-5.0 makes 5V_A from V+,\nfor U3, U4, U5, R4 and R5"
    drawing.add(elm.Label().at((0.8, -10.4)).label(text, fontsize=9))


def draw(file):
    """Draw the circuit into `file`."""
    with schemdraw.Drawing(file=str(file), show=False) as drawing:
        drawing.config(unit=2.0, fontsize=10)
        nano(drawing)
        converter(drawing)
        inputs(drawing)
        meters(drawing, sink(drawing))


if __name__ == "__main__":
    schemdraw.use("svg")
    draw(FILE)
