"""The workshop's process: what it is ordered comes back, what it knows stays the same thing, and it may die."""

import os
import signal
import time
from dataclasses import replace

import pytest

from smadrive.control.references.shapes import sine
from smadrive.hysteresis import DuhemModel, TriangularSets, TSFuzzyDuhem
from smadrive.identification.adaptation import Adaptation
from smadrive.measurement import Measurement
from smadrive.rig.config import load_rig
from smadrive.tuning.builder.builder import Order, Refused, prepare
from smadrive.tuning.link.mailbox import ParcelPair, other_end
from smadrive.tuning.link.messages import SetFeedback, SetShape
from smadrive.tuning.processes import BuilderProcess
from smadrive.tuning.tuning import ADAPTED, Adapted, Tuning
from smadrive.wire.heat_balance import HeatBalance

BALANCE = HeatBalance(0.0298, 0.014, 3.42e-5 * 24200.0, 22.0, 16.5, -0.12, 0.15)
REFERENCE = sine(low_mm=2.0, high_mm=9.0, period_s=40.0, cycles=1)
CENTRES = (40.0, 60.0, 70.0, 75.0, 80.0, 85.0, 90.0, 100.0, 120.0)
WIRE = DuhemModel.gaussian(
    mu_heating=89.9, mu_cooling=69.0, sigma_heating=5.0, sigma_cooling=5.0, scale=12.0, input_range=(0.0, 200.0)
)


def order(change, *, reference=REFERENCE):
    config = load_rig("in-process")
    tuning = Tuning.of(TSFuzzyDuhem.from_duhem(WIRE, TriangularSets(CENTRES)), config.feedback, "as loaded")
    return Order(tuning, change, reference, config, BALANCE)


def moved(mu_heating):
    return SetShape(number=1, act="shape", key="mu_heating", value=mu_heating)


@pytest.fixture(scope="module")
def workshop():
    with ParcelPair() as parcels, BuilderProcess(parcels) as workshop:
        yield workshop


def outcome(workshop, given):
    workshop.begin(given)
    while (outcome := workshop.outcome()) is None:
        time.sleep(0.005)
    return outcome


def test_it_prepares_what_would_be_prepared_here(workshop):
    given = order(moved(91.0))
    here, there = prepare(given), outcome(workshop, given)
    assert there.tuning.model.rules == here.tuning.model.rules
    assert there.tuning.shape == here.tuning.shape
    sample = Measurement(0.0, 60.0, 0.2, 0.6, 1.0)
    assert there.controller.update(0.0, sample, 0.05) == here.controller.update(0.0, sample, 0.05)


def test_no_file_of_the_present_folder_runs_in_its_place(tmp_path, monkeypatch):
    (tmp_path / "select.py").write_text("raise RuntimeError")
    monkeypatch.chdir(tmp_path)
    with ParcelPair() as parcels, BuilderProcess(parcels) as workshop:
        assert outcome(workshop, order(moved(91.0), reference=None)).controller is None


def test_what_the_loop_has_already_stays_the_same_thing(workshop):
    given = order(moved(91.0))
    shaped = outcome(workshop, given)
    assert shaped.reference is given.reference
    assert shaped.tuning.unmoved is given.tuning.unmoved
    settings = Order(
        shaped.tuning,
        SetFeedback(number=2, act="feedback", key="closed_loop_s", value=0.5),
        REFERENCE,
        given.config,
        BALANCE,
    )
    slower = outcome(workshop, settings)
    assert slower.tuning.model is shaped.tuning.model
    assert slower.tuning.feedback.closed_loop_s == 0.5


def test_without_a_reference_there_is_no_controller(workshop):
    assert outcome(workshop, order(moved(91.0), reference=None)).controller is None


def test_a_refusal_comes_back_with_its_reason(workshop):
    refused = outcome(workshop, order(moved(60.0)))
    assert isinstance(refused, Refused)
    assert "must exceed mu_cooling" in refused.reason


def test_an_order_that_died_with_its_process_is_refused_and_the_next_is_done(workshop):
    os.kill(workshop.pid, signal.SIGSTOP)
    workshop.begin(order(moved(91.0)))
    os.kill(workshop.pid, signal.SIGKILL)
    while (refused := workshop.outcome()) is None:
        time.sleep(0.005)
    assert "started anew" in refused.reason
    assert outcome(workshop, order(moved(92.0))).tuning.shape.mu_heating == 92.0


def test_parcels_of_any_size_do_not_wait_for_the_other_end():
    with ParcelPair() as ours:
        theirs = other_end((*ours.fds[:2], os.dup(ours.fds[2])))
        for number, size in enumerate((0, 10_000_000, 5)):
            assert ours.send(number, bytes(size))
            assert theirs.received() == (number, bytes(size))
        assert theirs.received() is None
        theirs.messages.close()
        ours.messages.close()
        assert not ours.send(9, b"nobody")


def test_rules_that_were_adapted_are_built_there_too(workshop):
    given = order(None)
    adaptation = Adaptation(given.tuning.model, 0.1)
    adapted = outcome(workshop, replace(given, change=Adapted(adaptation)))
    assert adapted.tuning.change == ADAPTED
    assert adapted.tuning.model.rules == adaptation.model.rules
