"""Numbers for readers."""

import json
import math

import numpy as np
import pytest

from quietbus.plain import ARCSEC, RPM, json_ready


def test_a_degree_has_3600_arcseconds():
    assert math.radians(1.0) * ARCSEC == pytest.approx(3600.0, rel=1e-15)


def test_a_turn_per_second_is_60_rpm():
    assert 2.0 * math.pi * RPM == pytest.approx(60.0, rel=1e-15)


def test_whatever_a_result_holds_json_can_hold():
    given = {
        "infinite": math.inf,
        "unknown": np.float64("nan"),
        "pole": -1.0 + 2.0j,
        "matrix": np.array([[1.0, np.inf]]),
        "nested": [{"a": (1, "x", None, True)}],
    }
    plain = {
        "infinite": None,
        "unknown": None,
        "pole": [-1.0, 2.0],
        "matrix": [[1.0, None]],
        "nested": [{"a": [1, "x", None, True]}],
    }
    assert json.loads(json.dumps(json_ready(given), allow_nan=False)) == plain
