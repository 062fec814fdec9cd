"""Data of Bode and Nyquist plots and root loci, against the loops they are of."""

import numpy as np

from oracles.loops import paper_control, paper_loop
from quietbus.analysis.control.loop_response import frequency_response, root_locus


def test_frequency_response_data():
    data = frequency_response(paper_loop(delay=0.02))
    expected = paper_control()(1j * data.omega) * np.exp(-0.02j * data.omega)
    np.testing.assert_allclose(data.response, expected, rtol=1e-9)
    np.testing.assert_allclose(np.exp(1j * np.radians(data.phase_deg)), expected / np.abs(expected))
    np.testing.assert_allclose(data.magnitude_db, 20 * np.log10(np.abs(expected)), atol=1e-8)
    assert np.all(np.diff(data.frequency_hz) > 0)
    assert np.min(np.abs(data.frequency_hz - 0.36933)) < 1e-5  # the crossover is a point of it


def test_root_locus_is_made_of_closed_loop_poles_in_continuous_branches():
    loop = paper_loop()
    locus = root_locus(loop)
    top = np.asarray(loop.numerator)
    for gain, poles in zip(locus.gains[::100], locus.poles[::100], strict=True):
        bottom = np.polyadd(loop.denominator, gain / 2500.0 * top)
        found = np.sort_complex(np.roots(bottom))
        np.testing.assert_allclose(np.sort_complex(poles), found, rtol=1e-8)
    jump = np.abs(np.diff(locus.poles, axis=0)) / np.abs(locus.poles[1:])
    assert np.max(jump) < 0.2
    assert 2500.0 in locus.gains
    # three branches end at the isolator's zeros, two at the PID's, two at infinity
    ends = locus.poles[-1]
    for zero in loop.zeros:
        assert np.min(np.abs(ends - zero)) < 0.03 * abs(zero)
