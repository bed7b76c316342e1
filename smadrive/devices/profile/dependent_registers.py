"""Dependent registers, whose sign, scale, unit or validity other registers determine. The keys of the profile:

sign_register   a register that holds the sign: 0 is positive, 1 is negative (sign and magnitude in two registers)
scale_from      a register whose enum lists the scale factors, for example { 0 = "1", 1 = "0.1" }
unit_from       a register whose enum lists the units: °C is used, °F is converted, other units are invalid
valid_when      allowed raw numbers of registers, for example { quality = [0, 1] }: while the register `quality` holds
                another number, the value is invalid
"""

from __future__ import annotations

from collections.abc import Mapping

from smadrive.devices.profile.readings import ALONE, Context, RegisterReading
from smadrive.devices.profile.register import Register
from smadrive.files.spelling import suggestion_or_list

CELSIUS, FAHRENHEIT = "degC", "degF"


def context_of(register: Register, readings: Mapping[str, RegisterReading]) -> Context:
    """Return the context of `register`, from the `readings` of the registers on which it depends."""
    if not register.depends_on:
        return ALONE
    sign = _word(register.sign_register, readings)
    scale = _word(register.scale_from, readings)
    unit = _word(register.unit_from, readings)
    problem = _state_problem(register, readings)
    for name, word in ((register.scale_from, scale), (register.unit_from, unit), (register.sign_register, sign)):
        if name is not None and word is None:
            problem = f"'{name}' is {readings[name].raw:g}, an unknown state"
    if unit not in (None, CELSIUS, FAHRENHEIT):
        problem = f"the device gives the value in '{unit}'"
    if sign not in (None, "0", "1"):
        problem = f"'{register.sign_register}' is {sign}, but must be 0 (positive) or 1 (negative)"
    return Context(
        sign=-1 if sign == "1" else 1,
        scale=None if scale is None else float(scale),
        fahrenheit=unit == FAHRENHEIT,
        problem=problem,
    )


def check_dependencies(name: str, register: Register, registers: Mapping[str, Register]) -> None:
    """Raise ValueError if a register on which `register` depends does not exist or cannot determine the value."""
    for dependency in register.depends_on:
        if dependency not in registers:
            hint = suggestion_or_list(dependency, registers)
            raise ValueError(f"registers.{name} names the unknown register '{dependency}'; {hint}")
        if registers[dependency].depends_on or not registers[dependency].access.startswith("r"):
            raise ValueError(
                f"registers.{name}: '{dependency}' must be readable and must not depend on another register"
            )
    if register.scale_from is not None:
        _check_scales(name, registers[register.scale_from].enum)
    if register.unit_from is not None and (
        register.unit != CELSIUS or CELSIUS not in registers[register.unit_from].enum.values()
    ):
        raise ValueError(
            f"registers.{name}: unit_from needs unit = '{CELSIUS}' in this register, and '{CELSIUS}' in the enum of "
            f"'{register.unit_from}'"
        )


def _check_scales(name: str, enum: Mapping[int, str]) -> None:
    try:
        usable = bool(enum) and all(float(word) > 0 for word in enum.values())
    except ValueError:
        usable = False
    if not usable:
        raise ValueError(
            f"registers.{name}.scale_from needs a register whose enum lists factors, for example {{ 1 = '0.1' }}"
        )


def _word(name: str | None, readings: Mapping[str, RegisterReading]) -> str | None:
    """Return the state of the register `name`: the word of its enum, or its raw number if it has no enum.

    None if `name` is None or the reading is invalid.
    """
    if name is None:
        return None
    reading = readings[name]
    if reading.invalid is not None:
        return None
    return reading.words[0] if reading.words else f"{reading.raw:g}"


def _state_problem(register: Register, readings: Mapping[str, RegisterReading]) -> str | None:
    for name, allowed in register.valid_when.items():
        if readings[name].raw not in allowed:
            return f"{name}: {_word(name, readings) or format(readings[name].raw, 'g')}"
    return None
