"""Mangled scenarios are refused by one message, at once, and without a word of our libraries."""

import warnings

import pytest

from scenario.mangled import faults


@pytest.mark.parametrize("first", range(0, 160, 40))
def test_mangled_scenarios_are_scenarios_or_refused(first):
    with warnings.catch_warnings():
        assert list(faults(40, first)) == []
