"""The model builder process: results arrive, the loop gets its own objects back, and the process may stop or die."""

import os
import signal
import time
from dataclasses import replace

import pytest

from smadrive.control.references.shapes import sine
from smadrive.hysteresis import TriangularSets, TSFuzzyDuhem
from smadrive.identification.adaptation.adaptation import ADAPTED, Adaptation
from smadrive.measurement import Measurement
from smadrive.rig.config import load_rig
from smadrive.tuning import processes
from smadrive.tuning.builder.build import BuildFailure, BuildRequest, build
from smadrive.tuning.link.requests import SetFeedback, SetShape
from smadrive.tuning.processes import BuilderProcess
from smadrive.tuning.tuning import Adapted, Tuning
from smadrive.wire.wire_properties import WireProperties
from tests.unit.tuning.conftest import BALANCE, REFERENCE, true_wire

LONG_REFERENCE = sine(low_mm=2.0, high_mm=9.0, period_s=300.0, cycles=2)
CENTRES = (40.0, 60.0, 70.0, 75.0, 80.0, 85.0, 90.0, 100.0, 120.0)


def build_request(change, *, reference=REFERENCE):
    config = load_rig("in-process")
    tuning = Tuning.of(TSFuzzyDuhem.from_duhem(true_wire(), TriangularSets(CENTRES)), config.feedback, "as loaded")
    return BuildRequest(tuning, change, reference, config, WireProperties(BALANCE))


def moved(mu_heating):
    return SetShape(number=1, act="shape", key="mu_heating", value=mu_heating)


@pytest.fixture(scope="module")
def builder():
    with BuilderProcess() as builder:
        yield builder


def awaited(builder):
    """Wait for the result of the builder."""
    while (result := builder.result()) is None:
        time.sleep(0.005)
    return result


def result_of(builder, request):
    builder.begin(request)
    return awaited(builder)


def test_result_equals_that_of_a_build_in_this_process(builder):
    request = build_request(moved(91.0))
    here, there = build(request), result_of(builder, request)
    assert there.tuning.model.rules == here.tuning.model.rules
    assert there.tuning.shape == here.tuning.shape
    sample = Measurement(0.0, 60.0, 0.2, 0.6, 1.0)
    assert there.controller.update(0.0, sample, 0.05) == here.controller.update(0.0, sample, 0.05)


@pytest.mark.exhaustive
def test_modules_of_the_present_folder_are_not_imported(tmp_path, monkeypatch):
    (tmp_path / "select.py").write_text("raise RuntimeError")
    monkeypatch.chdir(tmp_path)
    with BuilderProcess() as builder:
        assert result_of(builder, build_request(moved(91.0), reference=None)).controller is None


def test_loop_gets_its_own_objects_back(builder):
    request = build_request(moved(91.0))
    shaped = result_of(builder, request)
    assert shaped.reference is request.reference
    assert shaped.tuning.unmoved is request.tuning.unmoved
    slower = SetFeedback(number=2, act="feedback", key="closed_loop_s", value=0.5)
    result = result_of(builder, BuildRequest(shaped.tuning, slower, REFERENCE, request.config, WireProperties(BALANCE)))
    assert result.tuning.model is shaped.tuning.model
    assert result.tuning.feedback.closed_loop_s == 0.5


def test_without_a_reference_no_controller_is_built(builder):
    assert result_of(builder, build_request(moved(91.0), reference=None)).controller is None


def test_invalid_change_fails_with_its_reason(builder):
    failure = result_of(builder, build_request(moved(60.0)))
    assert isinstance(failure, BuildFailure)
    assert "mu_cooling" in failure.reason


@pytest.mark.exhaustive
def test_request_fails_when_its_process_dies_and_the_next_one_is_done(builder):
    os.kill(builder.pid, signal.SIGSTOP)
    builder.begin(build_request(moved(91.0)))
    os.kill(builder.pid, signal.SIGKILL)
    assert isinstance(awaited(builder), BuildFailure)
    assert result_of(builder, build_request(moved(92.0))).tuning.shape.mu_heating == 92.0


@pytest.mark.exhaustive
def test_request_sent_during_a_restart_is_done_by_the_new_process(builder):
    deaths, restarts = builder.deaths, builder.restarts
    os.kill(builder.pid, signal.SIGKILL)
    while builder.deaths == deaths:
        time.sleep(0.005)
    assert builder.restarts == restarts
    assert result_of(builder, build_request(moved(93.0))).tuning.shape.mu_heating == 93.0


def test_large_request_does_not_wait_for_a_stopped_process(builder):
    """The request is larger than the buffers of a socket."""
    os.kill(builder.pid, signal.SIGSTOP)
    try:
        builder.begin(build_request(moved(91.0), reference=LONG_REFERENCE))
        assert builder.result() is None
    finally:
        os.kill(builder.pid, signal.SIGCONT)
    assert awaited(builder).tuning.shape.mu_heating == 91.0


def test_adapted_rules_are_built(builder):
    request = build_request(None)
    adaptation = Adaptation(request.tuning.model, 0.1)
    adapted = result_of(builder, replace(request, change=Adapted(adaptation)))
    assert adapted.tuning.change == ADAPTED
    assert adapted.tuning.model.rules == adaptation.model.rules


@pytest.mark.exhaustive
def test_builder_that_hangs_is_replaced_and_its_change_fails(monkeypatch):
    monkeypatch.setattr(processes, "FROZEN_BUILD_LOOKS", 3)
    with BuilderProcess() as builder:
        hung = builder.pid
        os.kill(hung, signal.SIGSTOP)
        assert isinstance(result_of(builder, build_request(moved(91.0))), BuildFailure)
        monkeypatch.undo()
        assert result_of(builder, build_request(moved(91.0))).tuning is not None
        assert builder.pid != hung
