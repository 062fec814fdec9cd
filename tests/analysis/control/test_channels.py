"""Channels against the paper's coefficients, leg lengths, state space and symmetry."""

import json

import control
import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from quietbus.analysis.control.channels import channels
from quietbus.analysis.control.hexapod import SingleAxisPlatform, StrutMemory, hexapod_isolator
from quietbus.analysis.control.rational import minus_3db_frequency, peak
from quietbus.analysis.control.symbolic import SymbolicChannel

R3 = np.sqrt(3.0)
UPPER = np.array(
    [
        [0.5, -0.25, -0.25, 0.5, -0.25, -0.25],
        [0, 0.25 * R3, 0.25 * R3, 0, -0.25 * R3, -0.25 * R3],
        [0] * 6,
    ]
).T
LOWER = np.array(
    [
        [0.25, -0.5, 0.25, 0.25, -0.5, 0.25],
        [0.25 * R3, 0, 0.25 * R3, -0.25 * R3, 0, -0.25 * R3],
        [0] * 6,
    ]
).T
PAPER = {
    "upper_joints": UPPER,
    "lower_joints": LOWER,
    "separation": 0.25 * np.sqrt(2.0),
    "mass": 82.8,
    "inertia": [8.8, 8.8, 15.0],
    "center_of_mass": [0, 0, 0],
    "stiffness": 20e3,
    "damping": 500.0,
}
CROOKED = PAPER | {
    "center_of_mass": [0.03, -0.05, 0.12],
    "inertia": [[9.0, 0.3, -0.2], [0.3, 8.0, 0.5], [-0.2, 0.5, 15.0]],
    "stiffness": [20e3, 22e3, 19e3, 20e3, 21e3, 18e3],
    "damping": [500.0, 300.0, 700.0, 450.0, 0.0, 600.0],
}
OMEGA = np.geomspace(0.5, 300.0, 40)


def rotation_z(angle):
    cos, sin = np.cos(angle), np.sin(angle)
    return np.array([[cos, -sin, 0], [sin, cos, 0], [0, 0, 1.0]])


def three_parameter(k, k_B, c):
    """Keywords of struts k + k_B c s / (k_B + c s): z is the damper's elongation."""
    k, k_B, c = np.full(6, k), np.full(6, k_B), np.full(6, c)
    memory = StrutMemory(np.diag(-k_B), np.diag(k_B / c), np.zeros((6, 6)), np.diag(-k_B / c))
    return {"stiffness": k + k_B, "damping": 0.0, "memory": memory}


# --- the paper -------------------------------------------------------------------------------


def test_stiffness_of_the_papers_hexapod():
    """Section 8: K/k = diag(2, 2, 2, .25, .25, .75) with the couplings -+ sqrt(2)/4."""
    expected = np.diag([2, 2, 2, 0.25, 0.25, 0.75])
    expected[0, 4] = expected[4, 0] = -np.sqrt(2) / 4
    expected[1, 3] = expected[3, 1] = np.sqrt(2) / 4
    isolator = hexapod_isolator(**PAPER)
    np.testing.assert_allclose(isolator.stiffness_matrix / 20e3, expected, atol=1e-14)
    np.testing.assert_allclose(isolator.damping_matrix / 500.0, expected, atol=1e-14)


@pytest.mark.parametrize("axis", ["x", "y"])
def test_derived_coefficients_of_the_tilt_channels(axis):
    """Eq. 31-32: 70.4, 3.70, 0.03623 and the same in the numerator."""
    symbolic = getattr(channels(hexapod_isolator(**PAPER)), axis).symbolic
    top, bottom = symbolic.terms("numerator"), symbolic.terms("denominator")
    d_prime_m = 0.125 * 82.8
    static = (2 * 0.25 - 0.125) / d_prime_m
    # keys: powers of s, c, k
    assert top == pytest.approx(
        {
            (3, 1, 0): 1.0,
            (2, 2, 0): static,
            (2, 0, 1): 1.0,
            (1, 1, 1): 2 * static,
            (0, 0, 2): static,
        }
    )
    middle = (82.8 * 0.25 + 8.8 * 2) / d_prime_m
    assert bottom == pytest.approx(
        {
            (4, 0, 0): 82.8 * 8.8 / d_prime_m,
            (3, 1, 0): middle,
            (2, 2, 0): static,
            (2, 0, 1): middle,
            (1, 1, 1): 2 * static,
            (0, 0, 2): static,
        }
    )
    assert (round(bottom[4, 0, 0], 1), round(middle, 2), round(static, 5)) == (70.4, 3.70, 0.03623)


def test_derived_z_channel():
    """Eq. 33: (c s + k) / (20 s^2 + c s + k)."""
    z = channels(hexapod_isolator(**PAPER)).z
    assert str(z.symbolic) == "(c s + k) / (20 s^2 + c s + k)"
    assert z.numerator == pytest.approx((500, 20e3))
    assert z.denominator == pytest.approx((20, 500, 20e3))


@settings(max_examples=30, deadline=None)
@given(
    st.floats(1e2, 1e6),
    st.floats(0.0, 1e4),
    st.floats(10.0, 500.0),
    st.floats(1.0, 50.0),
)
def test_closed_form_of_the_papers_geometry(k, c, m, inertia):
    """G_R = u (d' m s^2 + (ad-b^2) u) / (m I s^4 + (m d + I a) u s^2 + (ad-b^2) u^2)."""
    design = {"stiffness": k, "damping": c, "mass": m, "inertia": [inertia, inertia, 15.0]}
    x = channels(hexapod_isolator(**PAPER | design)).x
    s = 1j * OMEGA
    u = c * s + k
    a, d, b2, d_prime = 2.0, 0.25, 0.125, 0.125
    expected = (u * (d_prime * m * s**2 + (a * d - b2) * u)) / (
        m * inertia * s**4 + (m * d + inertia * a) * u * s**2 + (a * d - b2) * u**2
    )
    np.testing.assert_allclose(x.response(OMEGA), expected, rtol=1e-8)


def test_corner_frequencies_from_the_printed_coefficients():
    """Section 8: peak of x at 2.463 Hz with gain 2.632; undamped 2.56 and 4.48 Hz."""
    numerator, denominator = SymbolicChannel((1, 0.036), (70.3, 3.69, 0.036)).coefficients(
        20e3, 500.0
    )
    omega, height = peak(numerator, denominator)
    assert round(omega / (2 * np.pi), 3) == 2.463
    assert round(height, 3) == 2.632
    undamped = np.unique(np.abs(np.roots(denominator)).round(6)) / (2 * np.pi)
    assert undamped.round(2).tolist() == [2.56, 4.48]


def test_frequencies_of_z_each_under_its_own_name():
    """Peak 4.50, damped 4.62, undamped 5.03 Hz."""
    z = channels(hexapod_isolator(**PAPER)).z
    (pole,) = z.poles
    (undamped,) = z.undamped_frequencies_hz
    assert round(z.peak_frequency_hz, 2) == 4.50
    assert round(pole.damped_frequency_hz, 2) == 4.62
    assert round(undamped, 2) == 5.03
    assert pole.natural_frequency_hz == pytest.approx(undamped)
    assert pole.damping_ratio == pytest.approx(500 / (2 * np.sqrt(20e3 * 20)))


def test_channels_of_the_paper_are_minimal_and_independent():
    result = channels(hexapod_isolator(**PAPER))
    assert [len(channel.denominator) - 1 for channel in result] == [4, 4, 2]
    assert result.largest_coupling == 0.0
    assert "independent" in result.verdict


# --- the model -------------------------------------------------------------------------------


def test_response_against_leg_lengths_and_forces():
    """Independent of the Jacobians: true leg lengths, forces at the joints, moments about D."""
    d = {name: np.asarray(value, float) for name, value in CROOKED.items()}
    foot = d["lower_joints"]
    com_D = d["center_of_mass"] + [0, 0, d["separation"]]

    def lengths(x):
        angle = np.linalg.norm(x[3:])
        axis = x[3:] / angle if angle else x[3:]
        cross = np.array([[0, -axis[2], axis[1]], [axis[2], 0, -axis[0]], [-axis[1], axis[0], 0]])
        turn = np.eye(3) + np.sin(angle) * cross + (1 - np.cos(angle)) * cross @ cross
        head = com_D + x[:3] + (d["upper_joints"] - d["center_of_mass"]) @ turn.T
        return np.linalg.norm(head - foot, axis=1)

    step = 1e-5
    slope = np.array([(lengths(e) - lengths(-e)) / (2 * step) for e in step * np.eye(6)]).T
    head = d["upper_joints"] + [0, 0, d["separation"]]
    direction = (head - foot) / np.linalg.norm(head - foot, axis=1, keepdims=True)
    mass = np.zeros((6, 6))
    mass[:3, :3], mass[3:, 3:] = d["mass"] * np.eye(3), d["inertia"]
    isolator = hexapod_isolator(**CROOKED)
    for omega in (1.0, 14.0, 90.0):
        strut = d["stiffness"] + 1j * omega * d["damping"]
        dynamic = slope.T @ (strut[:, None] * slope) - omega**2 * mass
        tension = strut[:, None] * slope @ np.linalg.solve(dynamic, np.eye(6))
        pull = tension[:, None, :] * direction[:, :, None]
        expected = np.vstack([pull.sum(0), np.cross(foot[:, :, None], pull, axis=1).sum(0)])
        np.testing.assert_allclose(isolator.transmissibility(omega), expected, atol=2e-9)


def test_response_against_state_space():
    isolator = hexapod_isolator(**CROOKED)
    inverse = np.linalg.inv(isolator.mass_matrix)
    a = np.block(
        [
            [np.zeros((6, 6)), np.eye(6)],
            [-inverse @ isolator.stiffness_matrix, -inverse @ isolator.damping_matrix],
        ]
    )
    b = np.vstack([np.zeros((6, 6)), inverse])
    c = isolator.legs_D.T @ np.hstack(
        [
            isolator.stiffness[:, None] * isolator.legs_P,
            isolator.damping[:, None] * isolator.legs_P,
        ]
    )
    system = control.ss(a, b, c, np.zeros((6, 6)))
    expected = np.moveaxis(system(1j * OMEGA), -1, 0)
    np.testing.assert_allclose(isolator.transmissibility(OMEGA), expected, atol=1e-9)


def test_channel_of_alike_struts_is_the_papers_with_their_dynamic_stiffness():
    """All of eq. 31-33 depends on s^2 and u = c s + k only: put u = Z(s)."""
    k, k_B, c = 20e3, 100e3, 900.0
    found = channels(hexapod_isolator(**PAPER | three_parameter(k, k_B, c)))
    s = 1j * OMEGA
    u = k + k_B * c * s / (k_B + c * s)
    for axis, plain in zip(found, channels(hexapod_isolator(**PAPER)), strict=True):
        ratio = s**2 / u
        symbols = plain.symbolic
        expected = np.polyval(symbols.numerator, ratio) / np.polyval(symbols.denominator, ratio)
        # numerator and denominator stand over the same power of u
        lift = len(symbols.denominator) - len(symbols.numerator)
        assert lift >= 0
        np.testing.assert_allclose(axis.response(OMEGA), expected, rtol=1e-9)
        assert axis.symbolic is None
        np.testing.assert_allclose(
            axis.undamped_frequencies_hz, plain.undamped_frequencies_hz, rtol=1e-9
        )
        assert len(axis.poles) < 6  # minimal: no memory that takes no part


def test_channels_of_unlike_struts_with_memory_equal_the_full_model():
    """Polynomials and poles against the 6 x 6 solve with each strut's own dynamic stiffness."""
    k = np.array([20e3, 22e3, 19e3, 20e3, 21e3, 18e3])
    k_B = np.array([100e3, 60e3, 80e3, 200e3, 10e3, 100e3])
    c = np.array([900.0, 500.0, 700.0, 1500.0, 50.0, 900.0])
    isolator = hexapod_isolator(**CROOKED | three_parameter(k, k_B, c))
    s = 1j * OMEGA[:, None]
    Z = k + k_B * c * s / (k_B + c * s)
    dynamic = s[..., None] ** 2 * isolator.mass_matrix + np.einsum(
        "li,wl,lj->wij", isolator.legs_P, Z, isolator.legs_P
    )
    through = np.einsum("li,wl,lj->wij", isolator.legs_D, Z, isolator.legs_P)
    full = through @ np.linalg.inv(dynamic)
    np.testing.assert_allclose(isolator.transmissibility(OMEGA), full, rtol=1e-9, atol=1e-12)
    for i, channel in enumerate(channels(isolator)):
        exact = full[:, 3 + i, 3 + i]
        error = np.abs(channel.response(OMEGA) - exact)
        assert np.max(error / (1 + np.abs(exact))) < 1e-9
        roots = np.roots(channel.denominator)
        for pole in channel.poles:
            assert np.min(np.abs(roots / complex(pole.real, pole.imag) - 1.0)) < 1e-6


def test_one_mass_on_its_struts_has_the_published_peak():
    """Three parameters with the best damping: peak 1 + 2/N at w0 sqrt(2 (N + 1)/(N + 2))."""
    N, k = 5.0, 20e3
    along = PAPER["separation"] / np.linalg.norm(
        UPPER + np.array([0, 0, PAPER["separation"]]) - LOWER, axis=1
    )
    k_A = k * np.sum(along**2)
    best = N * np.sqrt(2 * (N + 2)) / (4 * (N + 1)) * 2 * np.sqrt(k_A * PAPER["mass"])
    struts = three_parameter(k, N * k, best / np.sum(along**2))
    vertical = SingleAxisPlatform(hexapod_isolator(**PAPER | struts), along)
    w0 = np.sqrt(k_A / PAPER["mass"])
    assert vertical.natural_frequency == pytest.approx(w0, rel=1e-12)
    near = w0 * np.sqrt(2 * (N + 1) / (N + 2)) * np.linspace(0.9, 1.1, 2001)
    gains = vertical.transmissibility(near)
    assert gains.max() == pytest.approx(1 + 2 / N, rel=1e-9)
    assert np.argmax(gains) == 1000
    assert vertical.transmissibility(100 * w0) == pytest.approx(6.0e-4, rel=0.01)


def test_static_wrench_passes_unchanged():
    """At rest the base carries the load: its force, and its moment shifted to D."""
    isolator = hexapod_isolator(**CROOKED)
    x, y, z = np.add(CROOKED["center_of_mass"], [0, 0, CROOKED["separation"]])
    expected = np.eye(6)
    expected[3:, :3] = [[0, -z, y], [z, 0, -x], [-y, x, 0]]
    np.testing.assert_allclose(isolator.transmissibility(0.0).real, expected, atol=1e-12)


@pytest.mark.parametrize(
    "change",
    [
        {},
        {"damping": 0.0},
        {"damping": [500, 500, 500, 500, 500, 100]},
        {"center_of_mass": [0.0, 0.0, 0.1]},
        {"center_of_mass": [0.02, 0.0, 0.1]},
        {"upper_joints": UPPER.round(3), "lower_joints": LOWER.round(3)},
        {name: CROOKED[name] for name in ("center_of_mass", "inertia", "stiffness", "damping")},
    ],
)
def test_rational_channels_equal_the_full_model(change):
    """The reduced polynomials against the 6 x 6 solve, off resonance where undamped."""
    isolator = hexapod_isolator(**PAPER | change)
    full = isolator.torque_response(OMEGA)
    for i, channel in enumerate(channels(isolator)):
        error = np.abs(channel.response(OMEGA) - full[:, i, i])
        assert np.max(error / (1 + np.abs(full[:, i, i]))) < 1e-9


def test_symbolic_and_numeric_derivation_agree():
    """The same legs taken as unequal by a hair: the second path, through determinants."""
    equal = channels(hexapod_isolator(**PAPER)).x
    hair = 500.0 * (1 + 1e-10 * np.arange(6))
    numeric = channels(hexapod_isolator(**PAPER | {"damping": hair})).x
    assert numeric.symbolic is None
    assert numeric.denominator[0] == pytest.approx(1.0)
    lead = equal.denominator[0]
    np.testing.assert_allclose(np.multiply(numeric.denominator, lead), equal.denominator, rtol=1e-8)
    np.testing.assert_allclose(np.multiply(numeric.numerator, lead), equal.numerator, rtol=1e-8)


def test_symbolic_channel_holds_for_other_struts():
    """Derived at one (k, c), evaluated at another."""
    symbolic = channels(hexapod_isolator(**PAPER)).x.symbolic
    for k, c in [(5e3, 80.0), (3e4, 0.0)]:
        other = channels(hexapod_isolator(**PAPER | {"stiffness": k, "damping": c})).x
        top, bottom = symbolic.coefficients(k, c)
        np.testing.assert_allclose(top, other.numerator, rtol=1e-10)
        np.testing.assert_allclose(bottom, other.denominator, rtol=1e-10)


def test_terms_and_coefficients_are_the_same_polynomial():
    symbolic = channels(hexapod_isolator(**PAPER)).y.symbolic
    k, c, s = 7e3, 90.0, 0.3 + 2j
    for which, polynomial in zip(
        ("numerator", "denominator"), symbolic.coefficients(k, c), strict=True
    ):
        value = sum(a * s**i * c**j * k**l for (i, j, l), a in symbolic.terms(which).items())
        assert value == pytest.approx(np.polyval(polynomial, s), rel=1e-12)


# --- invariance and coupling -----------------------------------------------------------------


@settings(max_examples=10, deadline=None)
@given(st.permutations(range(6)))
def test_order_of_the_legs_does_not_matter(order):
    shuffled = {
        name: np.asarray(CROOKED[name])[order]
        for name in ("upper_joints", "lower_joints", "stiffness", "damping")
    }
    np.testing.assert_allclose(
        hexapod_isolator(**CROOKED | shuffled).torque_response(OMEGA),
        hexapod_isolator(**CROOKED).torque_response(OMEGA),
        atol=1e-10,
    )


@settings(max_examples=10, deadline=None)
@given(st.floats(-np.pi, np.pi))
def test_frame_turned_about_z(angle):
    """The response turns with the frame; the symmetric hexapod's channels do not change."""
    turn = rotation_z(angle)

    def turned(design):
        inertia = np.asarray(design["inertia"], float)
        inertia = np.diag(inertia) if inertia.ndim == 1 else inertia
        return design | {
            "upper_joints": np.asarray(design["upper_joints"]) @ turn.T,
            "lower_joints": np.asarray(design["lower_joints"]) @ turn.T,
            "center_of_mass": turn @ design["center_of_mass"],
            "inertia": turn @ inertia @ turn.T,
        }

    crooked = hexapod_isolator(**CROOKED).torque_response(OMEGA)
    np.testing.assert_allclose(
        hexapod_isolator(**turned(CROOKED)).torque_response(OMEGA),
        turn @ crooked @ turn.T,
        atol=1e-10,
    )
    for before, after in zip(
        channels(hexapod_isolator(**PAPER)),
        channels(hexapod_isolator(**turned(PAPER))),
        strict=True,
    ):
        np.testing.assert_allclose(after.numerator, before.numerator, rtol=1e-9)
        np.testing.assert_allclose(after.denominator, before.denominator, rtol=1e-9)
        assert after.coupling < 1e-9


def test_coupling_of_a_crooked_platform_is_the_largest_off_diagonal_gain():
    isolator = hexapod_isolator(**CROOKED)
    result = channels(isolator)
    gains = np.abs(isolator.torque_response(np.linspace(0.01, 100.0, 40001))).max(0)
    np.testing.assert_allclose(result.coupling, gains, rtol=1e-5)
    off = gains * (1 - np.eye(3))
    assert result.largest_coupling == pytest.approx(off.max(), rel=1e-5)
    base, torque = np.unravel_index(off.argmax(), off.shape)
    worst = (result.x, result.y, result.z)[torque]
    assert worst.coupling == result.largest_coupling
    assert worst.coupling_axis == "xyz"[base]
    assert "coupled" in result.verdict


def test_static_torque_does_not_couple():
    """A constant torque passes to its own axis alone, however crooked the platform."""
    response = hexapod_isolator(**CROOKED).torque_response(0.0)
    np.testing.assert_allclose(response, np.eye(3), atol=1e-12)


# --- figures read from a channel ---------------------------------------------------------------


@pytest.mark.parametrize("axis", ["x", "y", "z"])
@pytest.mark.parametrize("design", [PAPER, CROOKED])
def test_peak_and_minus_3db_against_a_fine_grid(design, axis):
    channel = getattr(channels(hexapod_isolator(**design)), axis)
    omega = np.linspace(1e-3, 120.0, 200001)
    gains = np.abs(channel.response(omega))
    at = gains.argmax()
    assert channel.peak_gain == pytest.approx(gains[at], rel=1e-8)
    assert channel.peak_gain >= gains[at]
    assert channel.peak_frequency_hz * 2 * np.pi == pytest.approx(omega[at], abs=2e-3)
    first = omega[np.argmax(gains < np.sqrt(0.5))]
    assert channel.minus_3db_frequency_hz * 2 * np.pi == pytest.approx(first, abs=1e-3)


def test_peak_of_a_rational_function_without_resonance():
    assert peak((1.0,), (1.0, 1.0)) == (0.0, 1.0)
    assert minus_3db_frequency((1.0,), (1.0, 1.0)) == pytest.approx(1.0)
    assert minus_3db_frequency((1.0,), (1.0,)) is None


def test_minus_3db_is_the_first_of_several_crossings():
    """A slow lag beside a resonance at 10 rad/s that rises through the line again."""
    top = np.polyadd([1, 0.1, 100.0], [2.0, 2.0])
    bottom = np.polymul([1, 1.0], [1, 0.1, 100.0])
    omega = np.linspace(1e-3, 50.0, 500001)
    gains = np.abs(np.polyval(top, 1j * omega) / np.polyval(bottom, 1j * omega))
    below = gains < np.sqrt(0.5) * top[-1] / bottom[-1]
    assert np.count_nonzero(np.diff(below.astype(int))) == 3
    first = omega[np.argmax(below)]
    assert minus_3db_frequency(top, bottom) == pytest.approx(first, abs=2e-4)


def test_undamped_channel_has_an_infinite_peak_and_clean_json():
    channel = channels(hexapod_isolator(**PAPER | {"damping": 0.0})).x
    assert channel.peak_gain == np.inf
    assert channel.peak_frequency_hz == pytest.approx(channel.undamped_frequencies_hz[0])
    assert channel.numerator[0] == pytest.approx(20e3)  # k s^2: no damper, no s^3
    assert json.loads(json.dumps(channel.to_dict(), allow_nan=False))["peak_gain"] is None


def test_json_has_the_agreed_keys():
    found = json.loads(json.dumps(channels(hexapod_isolator(**CROOKED)).to_dict(), allow_nan=False))
    assert set(found) == {"x", "y", "z"}
    for channel in found.values():
        agreed = {"numerator", "denominator", "peak_frequency_hz", "peak_gain"}
        assert agreed <= set(channel)


def test_to_control_is_the_same_function():
    x = channels(hexapod_isolator(**PAPER)).x
    np.testing.assert_allclose(x.to_control()(1j * OMEGA), x.response(OMEGA), rtol=1e-12)


# --- bad input -----------------------------------------------------------------------------------


@pytest.mark.parametrize(
    ("change", "message"),
    [
        ({"upper_joints": UPPER[:, :2]}, "upper_joints: expected n x 3"),
        ({"lower_joints": LOWER[:5]}, "lower_joints: expected 6 x 3"),
        ({"stiffness": [1.0, 2.0]}, "stiffness: expected 6"),
        ({"mass": 0.0}, "mass: expected a positive"),
        ({"inertia": [1.0, -1.0, 1.0]}, "positive definite"),
        ({"damping": -1.0}, "no negative"),
        ({"center_of_mass": [0, 0, np.nan]}, "center_of_mass: expected 3 finite"),
        ({"upper_joints": LOWER, "separation": 0.0}, "a leg has no length"),
        ({"stiffness": 0.0}, "free to move"),
    ],
)
def test_bad_input_is_refused_by_name(change, message):
    with pytest.raises(ValueError, match=message):
        hexapod_isolator(**PAPER | change)


def test_free_motion_is_named():
    """Upright legs hold nothing sideways; legs that meet the z axis, no turn about it."""
    upright = PAPER | {"lower_joints": UPPER}
    with pytest.raises(ValueError, match=r"6 legs leave the platform free.*(along|about) [xyz]"):
        hexapod_isolator(**upright)
    # all legs meet the z axis: only the turn about z is free
    meeting = PAPER | {
        "lower_joints": 0.5 * UPPER + np.array([[0, 0, 0.05 * (i % 2)] for i in range(6)])
    }
    with pytest.raises(ValueError, match=r"\([+-]1 about z \[m, rad\]\)"):
        hexapod_isolator(**meeting)
