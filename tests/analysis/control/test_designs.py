"""Many designs at once, and the paper's rule for one."""

import numpy as np
import pytest

from oracles.loops import INERTIA, PAPER_PID, PRINTED, paper_loop
from quietbus.analysis.control.designs import corner_rule, map_designs
from quietbus.analysis.control.margins import analyze_loop


def test_corner_rule_of_the_paper():
    """2.46 Hz over 0.37 Hz is what the paper calls about one decade."""
    rule = corner_rule(2.463, 0.3693)
    assert rule.passed
    assert round(rule.ratio, 1) == 6.7
    near = corner_rule(1.0, 0.3693)
    assert not near.passed
    assert "too near" in near.words
    assert corner_rule(2.463, None).ratio is None


def test_map_of_designs_equals_one_by_one():
    k, c = np.array([5e3, 20e3, 2e3]), np.array([100.0, 500.0, 20.0])
    found = map_designs(PRINTED, k, c, INERTIA, PAPER_PID, servo_bandwidth=50.0)
    for i in range(3):
        result = analyze_loop(paper_loop(PRINTED.coefficients(k[i], c[i]), servo_bandwidth=50.0))
        assert (found.gain_low[i], found.gain_high[i]) == result.stable_gain_range[0]
        np.testing.assert_equal(found.phase_margin_deg[i], result.phase_margin_deg or np.nan)
        assert found.stable[i] == result.stable
        margin = 20 * np.log10(result.stable_gain_range[0][1] / 2500.0)
        assert found.gain_margin_db[i] == pytest.approx(margin)
    assert found.peak_frequency_hz[1] == pytest.approx(2.463, abs=1e-3)
    assert found.peak_gain[1] == pytest.approx(2.632, abs=1e-3)
    assert found.stable.tolist() == [False, True, False]
