"""Draws schematic.svg, the circuit of the board in docs/board.md.

    python docs/board/schematic.py

Needs schemdraw. Wires with the same name are connected. The values are those of the range 1 A.
"""

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


def pins(side, names):
    """The pins of one side of a chip, from top to bottom."""
    count = len(names)
    return [IcPin(name=name, side=side, slot=f"{count - at}/{count}") for at, name in enumerate(names)]


def net(drawing, at, name, theta):
    """A short wire with the name of its net."""
    drawing.add(elm.Line().at(at).theta(theta).length(0.5))
    drawing.add(elm.Tag(width=1.5).theta(theta).label(name, fontsize=9))


def nano(drawing):
    """The Arduino Nano."""
    chip = drawing.add(
        elm.Ic(pins=[*pins("L", NANO_LEFT), *pins("R", NANO_RIGHT)], size=(3.6, 5.6), pinspacing=0.9)
        .at((0, 0))
        .label("U1 Arduino Nano\nATmega328P", "top", fontsize=11)
    )
    for name in NANO_LEFT:
        net(drawing, getattr(chip, name), NETS[name], 180)
    for name in NANO_RIGHT:
        net(drawing, getattr(chip, name), NETS[name], 0)


def converter(drawing):
    """The thermocouple converter, the bead, and the resistor that makes an open thermocouple read high."""
    names = ("DRDY", "CS", "SDI", "SDO", "SCK")
    chip = drawing.add(
        elm.Ic(pins=[*pins("L", names), *pins("R", ("T+", "T-"))], size=(2.8, 4.6), pinspacing=0.9)
        .at((8.6, 0.6))
        .label("U2 MAX31856\nbreakout, 3.3 V", "top", fontsize=11)
    )
    for name in names:
        net(drawing, getattr(chip, name), name, 180)
    plus, minus = chip["T+"], chip["T-"]
    drawing.add(elm.Line().at(plus).right(1.0))
    drawing.add(elm.Dot())
    node = drawing.here
    drawing.add(elm.Resistor().at(node).up(2.0).label("R1 10 MΩ", "bottom", fontsize=9))
    drawing.add(elm.Vdd().label("3.3 V", fontsize=9))
    drawing.add(elm.Line().at(node).right(2.2))
    bead = drawing.here
    drawing.add(elm.Line().at(minus).right(3.2))
    drawing.add(elm.Line().at(drawing.here).toy(bead))
    drawing.add(elm.Dot(radius=0.13).at(bead).label("type K,\nbead insulated\nfrom the wire", "right", fontsize=9))
    drawing.add(elm.Resistor().at((node[0] - 4.9, -1.2)).right(1.8).label("R2 10 kΩ", "bottom", fontsize=9))
    drawing.add(elm.Vdd().at(drawing.here).label("3.3 V", fontsize=9))
    net(drawing, (node[0] - 4.9, -1.2), "SDO", 180)


def inputs(drawing):
    """Emergency stop, jumper, displacement, enable pull-down, bus pull-ups."""
    y = -3.2
    net(drawing, (0.2, y), "ESTOP", 180)
    drawing.add(elm.Button(nc=True).at((0.2, y)).right(1.8).label("S1 emergency stop", "top", fontsize=9))
    drawing.add(elm.Ground())
    net(drawing, (0.2, y - 1.7), "JUMPER", 180)
    drawing.add(elm.Switch().at((0.2, y - 1.7)).right(1.8).label("J1 displacement fitted", "top", fontsize=9))
    drawing.add(elm.Ground())
    net(drawing, (0.2, y - 3.4), "EN", 180)
    drawing.add(elm.Resistor().at((0.2, y - 3.4)).right(1.8).label("R3 10 kΩ", "top", fontsize=9))
    drawing.add(elm.Ground())
    for x, name, resistor in ((6.6, "SDA", "R4 2.2 kΩ"), (6.6, "SCL", "R5 2.2 kΩ")):
        level = y if name == "SDA" else y - 1.7
        net(drawing, (x, level), name, 180)
        drawing.add(elm.Resistor().at((x, level)).right(1.8).label(resistor, "top", fontsize=9))
        drawing.add(elm.Vdd().label("5V_A", fontsize=9))
    net(drawing, (6.6, y - 3.4), "DISP", 180)
    drawing.add(elm.Dot())
    drawing.add(elm.Resistor().at((6.6, y - 3.4)).right(2.2).label("R6 39 kΩ", "top", fontsize=9))
    drawing.add(elm.Dot(open=True).label("sensor 0–5 V", "right", fontsize=9))
    drawing.add(elm.Resistor().at((6.6, y - 3.4)).down(1.8).label("R7 10 kΩ", "bottom", fontsize=9))
    drawing.add(elm.Ground())


def sink(drawing):
    """The current sink: DAC, divider, op-amp, enable switch, MOSFET."""
    y = -11.5
    dac = drawing.add(
        elm.Ic(pins=[*pins("L", ("SDA", "SCL")), *pins("R", ("OUT",))], size=(2.4, 2.2), pinspacing=0.9)
        .at((0, y - 1.1))
        .label("U3 MCP4725\nVDD = 5V_A", "top", fontsize=11)
    )
    for name in ("SDA", "SCL"):
        net(drawing, getattr(dac, name), name, 180)
    drawing.add(elm.Resistor().at(dac.OUT).right(2.4).label("R8 82 kΩ", "top", fontsize=9))
    drawing.add(elm.Dot())
    divided = drawing.here
    drawing.add(elm.Resistor().at(divided).down(2.4).label("R9 10 kΩ", "bottom", fontsize=9))
    drawing.add(elm.Ground())
    drawing.add(elm.Line().at(divided).right(1.2))
    amp = drawing.add(elm.Opamp(leads=True).flip().anchor("in2").label("U4\nMCP6022", "center", fontsize=8))
    switch = drawing.add(elm.Switch().at(amp.out).right(2.2).label("U5 74HC4066", "top", fontsize=9))
    drawing.add(elm.Line(ls=":").at((switch.center[0], switch.center[1] - 0.1)).down(1.4))
    drawing.add(elm.Label().label("EN closes", fontsize=9).at((switch.center[0] + 0.1, switch.center[1] - 1.9)))
    drawing.add(elm.Resistor().at(switch.end).right(1.8).label("R10 100 Ω", "top", fontsize=9))
    drawing.add(elm.Dot())
    gate = drawing.here
    drawing.add(elm.Resistor().at(gate).down(2.2).label("R11 10 kΩ", "bottom", fontsize=9))
    drawing.add(elm.Ground())
    drawing.add(elm.Line().at(gate).right(0.8))
    fet = drawing.add(elm.NFet(bulk=False).anchor("gate").theta(0).label("Q1 IRLZ44N", "right", fontsize=9))
    drawing.add(elm.Line().at(fet.source).down(0.6))
    drawing.add(elm.Dot())
    sense = drawing.here
    drawing.add(elm.Resistor().at(sense).down(2.2).label("R13 0.5 Ω 2 W", "bottom", fontsize=9))
    drawing.add(elm.Ground())
    below = (amp.in1[0] - 0.4, sense[1] - 2.9)
    drawing.add(elm.Line().at(sense).right(1.2))
    drawing.add(elm.Line().down(2.9))
    drawing.add(elm.Resistor().at(drawing.here).left(2.4).label("R12 1 kΩ", "bottom", fontsize=9))
    drawing.add(elm.Line().tox(below))
    drawing.add(elm.Line().toy(amp.in1))
    drawing.add(elm.Line().tox(amp.in1))
    return fet.drain


def meters(drawing, drain):
    """The wire, its supply, and the two meters."""
    drawing.add(elm.Line().at(drain).up(1.0))
    drawing.add(elm.Dot())
    low = drawing.here
    drawing.add(elm.Resistor().at(low).up(3.0).label("SMA wire", "bottom", fontsize=10))
    drawing.add(elm.Dot())
    top = drawing.here
    drawing.add(elm.Resistor().at(top).up(2.4).label("R14 0.05 Ω 1 %", "bottom", fontsize=9))
    drawing.add(elm.Dot())
    high = drawing.here
    drawing.add(elm.Fuse().at(high).up(2.2).label("F1 2 A", "bottom", fontsize=9))
    drawing.add(elm.Vdd().label("V+ 9 to 30 V, through the second pole of S1", fontsize=9))
    upper = drawing.add(
        elm.Ic(pins=[*pins("R", ("IN+", "IN-", "VBUS")), *pins("L", ("SDA", "SCL"))], size=(2.4, 3.0), pinspacing=1.0)
        .at((high[0] - 6.4, top[1] - 0.5))
        .label("U6 INA226\naddress 0x40", "top", fontsize=11)
    )
    drawing.add(elm.Line().at(upper["IN+"]).tox(high[0] - 2.2))
    drawing.add(elm.Line().toy(high))
    drawing.add(elm.Line().tox(high))
    for name in ("IN-", "VBUS"):
        drawing.add(elm.Line().at(upper[name]).tox(high[0] - 1.6))
        drawing.add(elm.Line().toy(top))
    drawing.add(elm.Line().at((high[0] - 1.6, top[1])).tox(top))
    lower = drawing.add(
        elm.Ic(pins=[*pins("R", ("VBUS",)), *pins("L", ("SDA", "SCL"))], size=(2.4, 2.0), pinspacing=0.9)
        .at((high[0] - 6.4, low[1] - 1.0))
        .label("U7 INA226\naddress 0x41", "top", fontsize=11)
    )
    drawing.add(elm.Line().at(lower.VBUS).tox(low))
    for chip in (upper, lower):
        for name in ("SDA", "SCL"):
            net(drawing, getattr(chip, name), name, 180)
    drawing.add(elm.Label().label("U8 LP2950-5.0: 5V_A from V+, for U3, U4, U5 and R4, R5", fontsize=9).at((2.6, -17.2)))


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
