"""The attitude loop against the paper, python-control, closed-loop poles and Pade delays."""

import json
import re

import control
import numpy as np
import pytest
from hypothesis import assume, given, settings
from hypothesis import strategies as st

from oracles.loops import (
    CHANNEL,
    INERTIA,
    PAPER_PID,
    PRINTED,
    RIGID,
    paper_control,
    paper_loop,
    unstable_at,
)
from quietbus.analysis.control.designs import map_designs
from quietbus.analysis.control.loop import Loop, attitude_loop
from quietbus.analysis.control.margins import analyze_loop
from quietbus.analysis.control.nyquist import nyquist_counts, stable_gain_range
from quietbus.analysis.control.pid import PID


def test_numbers_of_the_paper():
    """Section 8, from the printed coefficients, to the last digit of the checked column."""
    result = analyze_loop(paper_loop())
    ((low, high),) = result.stable_gain_range
    assert round(low, 3) == 0.547
    assert round(high) == 9114
    assert [round(value, 2) for value in result.gain_margins_db] == [-73.21, 11.24]
    assert [round(value, 3) for value in result.gain_margin_frequencies_hz] == [0.001, 2.819]
    assert round(result.phase_margin_deg, 2) == 87.97
    assert round(result.crossover_hz, 4) == 0.3693
    assert result.bandwidth_hz == result.crossover_hz
    counts = result.nyquist
    assert (counts.P, counts.N1, counts.N2, counts.N, counts.Z) == (0, 1, 1, 0, 0)
    assert result.stable
    assert result.consistent
    assert "conditionally" in result.verdict


def test_pid_by_gain_and_zeros():
    """K = 2500, t_p = 0.079, t_q = 5e-4: the paper rounds to 200, 0.1, 2500."""
    assert pytest.approx((198.75, 0.09875, 2500.0)) == (
        PAPER_PID.kp,
        PAPER_PID.ki,
        PAPER_PID.kd,
    )
    assert PAPER_PID.gain == 2500.0


@settings(max_examples=40, deadline=None)
@given(
    k=st.floats(500.0, 1e5),
    c=st.floats(5.0, 3000.0),
    kp=st.floats(1.0, 2000.0),
    ki=st.floats(0.001, 5.0),
    kd=st.floats(10.0, 2e4),
    servo=st.none() | st.floats(1.0, 200.0),
)
def test_margins_range_and_counts_of_any_design(k, c, kp, ki, kd, servo):
    loop = paper_loop(PRINTED.coefficients(k, c), PID(kp, ki, kd), servo_bandwidth=servo)
    result = analyze_loop(loop)
    system = control.tf(loop.numerator, loop.denominator)
    gm, pm, _, w_gm, w_pm, _ = control.stability_margins(system, returnall=True)
    np.testing.assert_allclose(result.gain_margins_db, 20 * np.log10(gm), atol=1e-5)
    np.testing.assert_allclose(result.gain_margin_frequencies_hz, w_gm / (2 * np.pi), rtol=1e-5)
    np.testing.assert_allclose(result.phase_margins_deg, pm, atol=1e-5)
    np.testing.assert_allclose(result.crossovers_hz, w_pm / (2 * np.pi), rtol=1e-6)

    assert result.consistent
    assert result.unstable_poles == unstable_at(loop, loop.gain)
    ends = [end for pair in result.stable_gain_range for end in pair if end]
    for gain in np.geomspace(1e-4, 1e6, 60):
        assume(all(abs(gain / end - 1) > 1e-6 for end in ends))
        inside = any(low < gain < (high or np.inf) for low, high in result.stable_gain_range)
        assert inside == (unstable_at(loop, gain) == 0)
        assert unstable_at(loop, gain) == nyquist_counts(loop, gain).Z


def test_loop_equals_the_one_of_python_control():
    omega = np.geomspace(1e-4, 1e3, 50)
    np.testing.assert_allclose(paper_loop().response(omega), paper_control()(1j * omega), rtol=1e-9)


def test_several_crossovers():
    """A weak damper lifts the resonance over 0 dB: three crossovers, the worst margin counts.

    The bandwidth stays where the loop first falls below one.
    """
    loop = paper_loop(PRINTED.coefficients(20e3, 20.0))
    result = analyze_loop(loop)
    omega = np.linspace(1e-3, 60.0, 600001)
    response = loop.response(omega)
    passes = np.flatnonzero(np.diff((np.abs(response) > 1).astype(int)))
    assert len(passes) == len(result.crossovers_hz) == 3
    np.testing.assert_allclose(2 * np.pi * np.array(result.crossovers_hz), omega[passes], atol=2e-4)
    margins = np.degrees(np.angle(-response[passes]))
    worst = np.argmin(np.abs(margins))
    assert worst != np.argmax(np.abs(margins))
    np.testing.assert_allclose(result.phase_margins_deg, margins, atol=0.5)
    assert not result.stable  # so that none of these is a margin
    assert result.phase_margin_deg is None
    assert 2 * np.pi * result.crossover_hz == pytest.approx(omega[passes[worst]], abs=2e-4)
    assert 2 * np.pi * result.bandwidth_hz == pytest.approx(omega[passes[0]], abs=2e-4)
    assert result.bandwidth_hz != result.crossover_hz


@pytest.mark.parametrize(("end", "beyond"), [(0, 0.5), (1, 2.0)])
def test_an_unstable_loop_has_no_phase_margin(end, beyond):
    """A reading at its crossover may say +87 degrees: there is nothing left to lose."""
    scale = beyond * analyze_loop(paper_loop()).stable_gain_range[0][end] / 2500.0
    loop = paper_loop(pid=PID(*(scale * k for k in (PAPER_PID.kp, PAPER_PID.ki, PAPER_PID.kd))))
    result = analyze_loop(loop)
    assert not result.stable
    assert len(result.crossovers_hz) > 0
    assert result.phase_margin_deg is None
    assert result.delay_margin_s is None


def test_delay_margin_with_a_phase_margin_beyond_180_degrees():
    """A delay only takes phase away: a lead of -m degrees is 360 - m to lose."""
    lead = Loop((1e4, 0.0, 0.0), tuple(np.poly([-1, -1, -1, -30, -30]).real))
    result = analyze_loop(lead)
    assert result.stable
    assert min(result.phase_margins_deg) < 0 < max(result.phase_margins_deg)
    delays = np.linspace(1e-4, 3.0, 3000) * result.delay_margin_s
    first = next(
        delay
        for delay in delays
        if not analyze_loop(Loop(lead.numerator, lead.denominator, delay=delay)).stable
    )
    assert first == pytest.approx(result.delay_margin_s, rel=2e-3)


def test_negative_leading_gain_counts_by_its_size():
    pid = PID(-200.0, -0.1, -2500.0)
    assert pid.gain == 2500.0
    result = analyze_loop(paper_loop(pid=pid))
    assert result.gain == 2500.0
    assert not result.stable
    assert result.unstable_poles == unstable_at(paper_loop(pid=pid), 2500.0)
    assert result.consistent


def test_phase_starts_at_the_integrators_and_is_continuous():
    loop = paper_loop()
    omega = np.geomspace(1e-8, 1e5, 4000)
    phase = loop.phase(omega)
    assert phase[0] == pytest.approx(-1.5 * np.pi, abs=1e-3)
    assert phase[-1] == pytest.approx(-np.pi, abs=1e-2)
    assert np.max(np.abs(np.diff(phase))) < 0.2
    np.testing.assert_allclose(
        np.exp(1j * phase), np.exp(1j * np.angle(paper_control()(1j * omega)))
    )


def test_phase_passes_unstable_resonances_without_a_jump():
    """Conjugate poles and zeros in the right half-plane, at a gain where a jump would count."""
    poles = np.poly([1 + 2j, 1 - 2j, -3, -4]).real
    loop = Loop(tuple(200.0 * np.poly([0.5 + 3j, 0.5 - 3j]).real), tuple(poles))
    omega = np.linspace(1e-3, 20.0, 20001)
    phase = loop.phase(omega)
    assert np.max(np.abs(np.diff(phase))) < 0.05
    expected = np.polyval(loop.numerator, 1j * omega) / np.polyval(poles, 1j * omega)
    np.testing.assert_allclose(loop.response(omega), expected, rtol=1e-9)
    for gain in (0.01, 0.1, 1.0, 10.0):
        assert unstable_at(loop, gain) == nyquist_counts(loop, gain).Z


def test_delay_margin_is_where_a_pole_reaches_the_axis():
    """Directly: with exactly that delay, 1 + L = 0 at the crossover."""
    result = analyze_loop(paper_loop())
    omega = 2 * np.pi * result.crossover_hz
    delayed = paper_control()(1j * omega) * np.exp(-1j * omega * result.delay_margin_s)
    assert delayed == pytest.approx(-1.0, abs=1e-9)
    assert analyze_loop(paper_loop(delay=0.999 * result.delay_margin_s)).stable
    beyond = analyze_loop(paper_loop(delay=1.001 * result.delay_margin_s))
    assert beyond.unstable_poles == 2
    assert beyond.delay_margin_s is None
    half = analyze_loop(paper_loop(delay=0.5 * result.delay_margin_s))
    assert half.delay_margin_s == pytest.approx(0.5 * result.delay_margin_s)


def test_margins_with_delay_satisfy_their_definition():
    loop = paper_loop(delay=0.05, servo_bandwidth=50.0)
    result = analyze_loop(loop)
    omega = 2 * np.pi * np.array(result.gain_margin_frequencies_hz)
    gain = 10 ** (np.array(result.gain_margins_db) / 20)
    lag = np.exp(-0.05j * omega) / (1 + 1j * omega / 50.0)
    np.testing.assert_allclose(gain * paper_control()(1j * omega) * lag, -1.0, atol=1e-8)


def test_vanishing_delay_changes_nothing():
    plain, delayed = analyze_loop(paper_loop()), analyze_loop(paper_loop(delay=1e-9))
    np.testing.assert_allclose(delayed.stable_gain_range, plain.stable_gain_range, rtol=1e-6)
    np.testing.assert_allclose(delayed.gain_margins_db[:2], plain.gain_margins_db, rtol=1e-6)


def test_sampling_against_the_exact_discrete_loop():
    """Zero order hold on the plant, attitude and rate sampled: half a sample of delay is near."""
    period = 0.05
    pid = PID(200.0, 0.0, 2500.0)
    plant = control.tf(*CHANNEL) * control.tf([pid.kd, pid.kp], [INERTIA, 0, 0])
    discrete = control.sample_system(control.ss(plant), period, method="zoh")

    def unstable(scale):
        return np.max(np.abs((discrete * scale).feedback(1).poles())) > 1 + 1e-9

    ((_, high),) = stable_gain_range(paper_loop(pid=pid, sampling_period=period))
    ((_, continuous),) = stable_gain_range(paper_loop(pid=pid))
    assert high < 0.9 * continuous
    assert not unstable(0.97 * high / 2500.0)
    assert unstable(1.03 * high / 2500.0)


def test_slow_sampling_is_said():
    assert not analyze_loop(paper_loop(sampling_period=0.05)).notes
    assert "rough" in analyze_loop(paper_loop(sampling_period=0.5)).notes[0]


@pytest.mark.parametrize(
    ("pid", "words", "stable"),
    [
        (PID(0, 0, 0), "No control", False),
        (PID(0, 0, 2500), "the attitude drifts", False),
        (PID(200, 0.1, 0), "No gain K makes it stable", False),
        (PID(200, 0.1, 2e4), "Unstable at K = 2e\\+04: 2 poles .* Stable for 0.*< K <", False),
        (PID(200, 0, 2500), "Stable at K = 2500. Stable for 0 < K <", True),
    ],
)
def test_verdicts(pid, words, stable):
    result = analyze_loop(paper_loop(pid=pid))
    assert re.search(words, result.verdict)
    assert result.stable == stable
    assert result.consistent
    json.dumps(result.to_dict(), allow_nan=False)


def test_rate_feedback_alone_has_no_stable_range():
    """The attitude's pole at the origin is not in the loop, and no gain moves it."""
    assert stable_gain_range(paper_loop(pid=PID(0.0, 0.0, 2500.0))) == ()
    assert analyze_loop(paper_loop(pid=PID(0.0, 0.0, 2500.0))).stable_gain_range == ()


def test_rigid_mount_has_no_upper_limit():
    """PID and 1/(I s^2): stable above K = I tp tq/(tp + tq), by Routh."""
    tp, tq = 0.079, 5e-4
    result = analyze_loop(paper_loop(RIGID))
    ((low, high),) = result.stable_gain_range
    assert low == pytest.approx(INERTIA * tp * tq / (tp + tq))
    assert high is None
    pd = analyze_loop(paper_loop(RIGID, PID(200.0, 0.0, 2500.0)))
    assert pd.stable_gain_range == ((0.0, None),)
    assert pd.gain_margins_db == ()


def test_proportional_control_alone_is_on_the_limit():
    """kp/(I s^2) lies on the negative real axis, through -1."""
    result = analyze_loop(paper_loop(RIGID, PID(200.0, 0.0, 0.0)))
    assert "limit" in result.verdict
    assert result.nyquist is None
    assert result.stable_gain_range == ()
    assert not result.stable


def test_chosen_gain_on_the_end_of_the_range():
    high = stable_gain_range(paper_loop())[0][1]
    result = analyze_loop(paper_loop(pid=PID.from_gain_and_zeros(high, (0.079, 5e-4))))
    assert "limit" in result.verdict
    assert result.nyquist is None
    assert not result.stable


def test_no_crossover_is_none_and_said():
    result = analyze_loop(Loop((0.5,), (1.0, 1.0)))
    assert result.stable
    assert result.phase_margin_deg is result.crossover_hz is result.delay_margin_s is None
    assert "no crossover" in result.notes[0]


def test_undamped_isolator_is_analysed():
    loop = paper_loop(PRINTED.coefficients(20e3, 0.0))
    result = analyze_loop(loop)
    assert result.unstable_poles == unstable_at(loop, loop.gain) == 4
    assert result.consistent
    assert len(result.gain_margins_db) == 1  # a passage at infinity, at a pole, has no margin


@pytest.mark.parametrize(
    ("options", "message"),
    [
        ({"delay": -1.0}, "delay: expected"),
        ({"delay": np.inf}, "delay: expected"),
        ({"servo_bandwidth": 0.0}, "servo_bandwidth: expected"),
        ({"sampling_period": -0.1}, "sampling_period: expected"),
    ],
)
def test_bad_options_are_refused_by_name(options, message):
    with pytest.raises(ValueError, match=message):
        paper_loop(**options)


def test_other_bad_input():
    with pytest.raises(ValueError, match="inertia: expected"):
        attitude_loop(*CHANNEL, 0.0, PAPER_PID)
    with pytest.raises(ValueError, match="strictly proper"):
        Loop((1.0, 1.0), (1.0, 2.0))
    with pytest.raises(ValueError, match="infinitely many"):
        paper_loop(delay=0.1).closed_loop_poles()
    with pytest.raises(ValueError, match="pid: expected"):
        map_designs(PRINTED, 20e3, 500.0, INERTIA, PID(0, 0, 0))


def test_json_has_the_agreed_keys():
    found = json.loads(json.dumps(analyze_loop(paper_loop()).to_dict(), allow_nan=False))
    assert {
        "stable_gain_range",
        "gain_margins_db",
        "gain_margin_frequencies_hz",
        "phase_margin_deg",
        "crossover_hz",
        "nyquist",
    } <= set(found)
    assert found["nyquist"] == {"P": 0, "N1": 1, "N2": 1, "N": 0, "Z": 0}
    rigid = analyze_loop(paper_loop(RIGID)).to_dict()
    assert rigid["stable_gain_range"][0][1] is None
