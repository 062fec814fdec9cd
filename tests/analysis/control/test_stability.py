"""Ranges of the gain."""

import numpy as np

from quietbus.analysis.control.stability import nearest_range


def test_nearest_range():
    ranges = ((1.0, 2.0), (50.0, 60.0), (1e4, None))
    assert nearest_range(ranges, 1.5) == (1.0, 2.0)
    assert nearest_range(ranges, 30.0) == (50.0, 60.0)
    assert nearest_range(ranges, 1e9) == (1e4, np.inf)
    assert np.isnan(nearest_range((), 1.0)).all()
