"""The choice of memory by held-out loops, on wires whose memory is known."""

import numpy as np
import pytest

from smadrive.errors import IdentificationError
from smadrive.hysteresis import DuhemModel, TSFuzzyDuhem, TSFuzzyPreisach
from smadrive.identification.memory.fit import choose, identify_memory
from smadrive.identification.memory.plane_fit import grid_of
from smadrive.identification.record import prepare
from smadrive.identification.tsfuzzy.fit import fit_rules

from .conftest import COLD, DUHEM, MixedWire, errors_on_unseen_loops, nested_loops, path, reversal_curves


@pytest.mark.exhaustive
def test_a_duhem_wire_has_no_memory(rng):
    v = nested_loops(rng)
    fit = identify_memory(v, DUHEM.simulate(v))
    assert type(fit.model) is TSFuzzyDuhem
    assert fit.memory.sets == 1
    assert fit.memory.caveats == ()


@pytest.mark.exhaustive
def test_half_of_a_wire_has_memory(rng):
    wire, v = MixedWire(0.5, 0.4, rng), nested_loops(rng, samples=1200)
    record = prepare(v, 4.0 - 3.0 * wire.simulate(v), None)
    model, _, memory = choose(record, 20, fit_rules, fit_rules(record))
    assert isinstance(model, TSFuzzyPreisach)
    assert model.share == pytest.approx(0.5, abs=0.15)
    assert model.scale < 0
    assert model.certificate().holds
    assert memory.sets == 20
    assert memory.with_percent < 0.4 * memory.without_percent
    errors = errors_on_unseen_loops(model, _Scaled(wire), rng, 5)
    assert np.median(errors[:, 0]) < 3 * 0.5


class _Scaled:
    def __init__(self, wire):
        self.wire = wire

    def simulate(self, v):
        return 4.0 - 3.0 * self.wire.simulate(v)


@pytest.mark.exhaustive
def test_a_given_number_of_sets_is_used(rng):
    wire, v = MixedWire(0.0, 0.4, rng), reversal_curves(samples=1500)
    fit = identify_memory(v, wire.simulate(v), memory=16)
    assert isinstance(fit.model, TSFuzzyPreisach)
    assert len(fit.model.plane.up_thresholds) <= 16
    assert fit.memory.sets == 16
    assert identify_memory(v, wire.simulate(v), memory=1).memory.sets == 1


@pytest.mark.exhaustive
def test_memory_that_is_not_there_is_not_claimed(rng):
    v = nested_loops(rng, samples=900)
    fit = identify_memory(v, DUHEM.simulate(v), memory=8)
    assert fit.memory.sets == (8 if isinstance(fit.model, TSFuzzyPreisach) else 1)
    assert not isinstance(fit.model, TSFuzzyPreisach) or fit.model.share < 0.1


@pytest.mark.exhaustive
def test_too_few_loops_are_told(rng):
    wire, v = MixedWire(0.0, 0.0, rng), path([COLD, 110.0, 50.0, 92.0, 68.0, 86.0, 50.0], 900)
    fit = identify_memory(v, wire.simulate(v))
    assert type(fit.model) is TSFuzzyDuhem
    assert len(fit.memory.caveats) == 1
    assert set(fit.memory.caveats) <= set(fit.caveats)


def test_given_memory_is_fitted_to_a_record_of_one_loop(rng):
    wire, v = MixedWire(0.0, 0.0, rng), path([COLD, 110.0, COLD], 400)
    fit = identify_memory(v, wire.simulate(v), memory=8)
    assert isinstance(fit.model, TSFuzzyPreisach)
    assert fit.memory.caveats


def test_thresholds_of_a_steep_wire_are_not_lost():
    """The range is 200 K, and the steep part of the branch some 2 K."""
    steep = DuhemModel.gaussian(
        mu_heating=90.0, mu_cooling=70.0, sigma_heating=0.5, sigma_cooling=0.5, input_range=(COLD - 10, 200.0)
    )
    v = path([COLD, 190.0, COLD], 40_000)
    grid = grid_of(prepare(v, steep.simulate(v), 0.01), 40)
    rise = steep.branch(grid.up, rising=True)
    assert np.diff(rise).max() < 0.25


@pytest.mark.parametrize("memory", [0, 2, 3, 41, 2.5])
def test_an_impossible_number_of_sets_is_refused(rng, memory):
    v = nested_loops(rng, samples=600)
    with pytest.raises(IdentificationError) as error:
        identify_memory(v, DUHEM.simulate(v), memory=memory)
    assert error.value.limit == "1 for no memory, or 4 to 40"


@pytest.mark.exhaustive
def test_a_one_sided_record_is_explained_by_the_plane_unless_rules_are_much_better(rng):
    """Rules and relays with nearly independent thresholds predict nearly the same falling curves."""
    v = reversal_curves(samples=1500)
    for wire, kind, caveats in ((MixedWire(0.0, 0.2, rng), TSFuzzyPreisach, 1), (DUHEM, TSFuzzyDuhem, 0)):
        record = prepare(v, wire.simulate(v), None)
        model, _, memory = choose(record, 28, fit_rules, fit_rules(record))
        assert type(model) is kind
        assert len(memory.caveats) == caveats


@pytest.mark.exhaustive
@pytest.mark.parametrize("seed", [0, 3, 4])
@pytest.mark.parametrize(("noise_c", "noise", "bounds"), [(0.0, 0.0, (0.6, 1.5, 5.0)), (0.1, 0.002, (0.8, 1.8, 6.0))])
def test_unseen_loops_of_preisach_wires(seed, noise_c, noise, bounds):
    rng = np.random.default_rng(seed)
    wire, v = MixedWire(0.0, rng.uniform(0.0, 0.9), rng), reversal_curves()
    y = wire.simulate(v) + noise * rng.standard_normal(len(v))
    fit = identify_memory(v + noise_c * rng.standard_normal(len(v)), y)
    errors = errors_on_unseen_loops(fit.model, wire, rng, 30)
    rms, largest = errors.max(axis=0)
    print(f"unseen loops: median {np.median(errors[:, 0]):.2f}, worst {rms:.2f}, largest {largest:.2f} %")
    assert np.median(errors[:, 0]) <= bounds[0]
    assert rms <= bounds[1]
    assert largest <= bounds[2]


@pytest.mark.exhaustive
@pytest.mark.parametrize("seed", [6, 7])
@pytest.mark.parametrize("theta", [0.25, 0.5, 0.75])
def test_unseen_loops_of_mixtures(theta, seed):
    rng = np.random.default_rng(seed)
    wire, v = MixedWire(theta, rng.uniform(0.0, 0.9), rng), nested_loops(rng)
    errors = errors_on_unseen_loops(identify_memory(v, wire.simulate(v)).model, wire, rng, 30)
    print(f"unseen loops, {theta:.0%} Duhem: median {np.median(errors[:, 0]):.2f}, worst {errors[:, 0].max():.2f} %")
    assert np.median(errors[:, 0]) <= 0.8
    assert errors[:, 0].max() <= 2.0
