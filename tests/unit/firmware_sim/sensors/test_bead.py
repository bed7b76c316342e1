"""The bead of the thermocouple: its lag and its reading, tight and loose."""

from math import exp

import pytest

from firmware_sim.sensors.bead import AIR, Bead

WIRE_C, AIR_C = 138.0, 22.0


def at_rest(bead):
    for _ in range(3000):
        bead.advance(WIRE_C, WIRE_C, AIR_C, 0.01)
    return bead.temperature_c


def test_tight_bead_follows_the_wire_with_its_lag():
    bead = Bead(AIR_C, 0.15)
    bead.advance(WIRE_C, WIRE_C, AIR_C, 0.15)
    assert bead.temperature_c == pytest.approx(WIRE_C + (AIR_C - WIRE_C) * exp(-1.0))
    assert at_rest(bead) == pytest.approx(WIRE_C)


@pytest.mark.parametrize("contact", [0.5, AIR])
def test_loose_bead_is_slower_and_reads_too_cold(contact):
    bead = Bead(AIR_C, 0.15)
    bead.loosen_bead(contact, over_s=1.0)
    share = contact * (1.0 + AIR) / (contact + AIR)
    assert at_rest(bead) == pytest.approx(AIR_C + share * (WIRE_C - AIR_C), abs=0.01)
    before_c = bead.temperature_c
    bead.advance(AIR_C, AIR_C, AIR_C, 0.15)
    decay = exp(-(contact + AIR) / (1.0 + AIR))
    assert bead.temperature_c == pytest.approx(AIR_C + (before_c - AIR_C) * decay)
    bead.loosen_bead(1.0, over_s=1.0)
    assert at_rest(bead) == pytest.approx(WIRE_C)


def test_bead_without_lag_has_the_temperature_of_the_wire():
    bead = Bead(AIR_C, 0.0)
    bead.advance(AIR_C, WIRE_C, AIR_C, 0.01)
    assert bead.temperature_c == WIRE_C
