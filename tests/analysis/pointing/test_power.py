"""Cumulative power by contributor."""

import numpy as np
import pytest

from quietbus.analysis.pointing.motion import SampledSignal
from quietbus.analysis.pointing.power import Density, LinePower, cumulative, rms_above

PARTS = {
    "wheels": LinePower(np.array([100.0, 20.0]), np.array([3.0, 1.0])),
    "noise": Density(np.array([0.0, 50.0, 150.0]), np.array([0.2, 0.0, 0.1])),
}


def test_contributors_add_up_from_either_end():
    up, down = (cumulative(PARTS, way, (1.0, 200.0)) for way in ("forward", "backward"))
    assert up.whole[-1] == pytest.approx(4.0 + 0.5 * 50 * 0.2 + 0.5 * 100 * 0.1)
    assert up.whole + down.whole == pytest.approx(np.full(len(up.frequency_hz), up.whole[-1]))
    assert np.all(np.diff(up.whole) >= 0.0)
    at = {f: i for i, f in enumerate(up.frequency_hz)}
    assert up.parts["wheels"][at[20.0] - 1] == 0.0
    assert up.parts["wheels"][at[20.0]] == 1.0
    assert up.parts["noise"][at[50.0]] == pytest.approx(5.0)
    assert up.parts["noise"][at[100.0]] == pytest.approx(5.0 + 0.5 * 50 * 0.05)


def test_rms_above_a_frequency_counts_the_line_on_it():
    lines = {"wheels": PARTS["wheels"]}
    assert rms_above(lines, 100.0) == pytest.approx(np.sqrt(3.0))
    assert rms_above(lines, 100.1) == 0.0
    assert rms_above(lines, 0.0) == pytest.approx(2.0)
    assert rms_above(PARTS, 100.0) == pytest.approx(np.sqrt(3.0 + 0.5 * 50 * (0.05 + 0.1)))


def test_mean_square_of_samples_above_a_frequency():
    """Two lines, one on either side, in two components."""
    t = np.arange(4001) / 1000.0
    fast, slow = np.cos(2 * np.pi * 80 * t + 0.3), np.cos(2 * np.pi * 11 * t)
    signal = SampledSignal(t, np.column_stack([2 * fast + slow, fast - 5 * slow]))
    found = signal.mean_square_above(40.0, 0.0, 4.0)
    assert found == pytest.approx(np.array([[2.0, 1.0], [1.0, 0.5]]), rel=1e-3)
    assert np.trace(signal.mean_square_above(0.0, 0.0, 4.0)) == pytest.approx(15.5, rel=2e-3)
    assert not np.any(signal.mean_square_above(500.0, 0.0, 4.0))
    with pytest.raises(ValueError, match="16 samples"):
        signal.mean_square_above(40.0, 0.0, 0.01)


def test_wrong_input_is_refused():
    with pytest.raises(ValueError, match="forward or backward, got 'up'"):
        cumulative(PARTS, "up")
    with pytest.raises(ValueError, match="one contributor or more"):
        cumulative({})
    with pytest.raises(ValueError, match="increasing"):
        Density(np.array([1.0, 0.5]), np.array([1.0, 1.0]))
