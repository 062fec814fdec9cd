"""Orders, bearing modes and noise of the rotors against hand-made rotations and state matrices."""

import jax
import jax.numpy as jnp
import numpy as np
import pytest
from scipy.interpolate import make_interp_spline
from scipy.signal import welch
from scipy.spatial.transform import Rotation

from oracles.satellites import awkward_satellite, paper_satellite, with_cluster
from quietbus.model.disturbance import Disturbance, Noise, Spectrum, on_carrier
from quietbus.solve.noise import with_noise

SILENT = ((None,) * 4,) * 4
SPIN, ACROSS = 15.0 / (200 * np.pi), 9.0 / (200 * np.pi)  # [kg m^2] of the paper's rotors


def disturbance(order=(1.0, 2.0, 2.83), period=(0.0, 0.0, 0.0), damping=(0.02,) * 3, **changes):
    shape = (4, len(order), 6)
    fields = {
        "orders": order,
        "coefficient": jnp.zeros(shape),
        "phase": jnp.zeros(shape),
        "period": jnp.tile(jnp.array(period), (4, 1)),
        "damping": jnp.tile(jnp.array(damping), (4, 1)),
        "broadband": SILENT,
    }
    return Disturbance(**(fields | changes))


def test_wrench_on_the_plate_is_that_of_vectors_turned_by_hand():
    """Every channel, tilted bearings, rotor centres off the axis, rotors turning both ways."""
    cluster = awkward_satellite().clusters[0].units
    rng = np.random.default_rng(4)
    coefficient, phase = rng.uniform(0.5, 1, (2, 4, 3, 6)) * 1e-6
    phase = 1e6 * phase
    shaking = disturbance(coefficient=jnp.array(coefficient), phase=jnp.array(phase))
    gamma, phi = rng.normal(size=(2, 4))

    @jax.jit
    def push(gamma, phi):
        each = shaking.wrench(cluster, jnp.zeros(()), phi, cluster.rotor_speed)
        return on_carrier(cluster, gamma, each[:, None])[:, 0]

    found = np.asarray(push(gamma, phi))
    for j in range(4):
        force, torque = np.zeros((2, 3))
        x, y, _ = np.array(cluster.R_GF[j]).T
        for k, h in enumerate((1.0, 2.0, 2.83)):
            size = coefficient[j, k] * float(cluster.rotor_speed[j]) ** 2
            turned = h * phi[j] + phase[j, k]
            # y turned about the spin axis, with the rotor's angle and against it
            vectors = [
                Rotation.from_rotvec(turned[0] * x).apply(y),
                Rotation.from_rotvec(-turned[1] * x).apply(y),
                np.cos(turned[2]) * x,
                Rotation.from_rotvec(turned[3] * x).apply(y),
                Rotation.from_rotvec(-turned[4] * x).apply(y),
                np.cos(turned[5]) * x,
            ]
            force += sum(size[c] * vectors[c] for c in range(3))
            torque += sum(size[c] * vectors[c] for c in range(3, 6))
        G = np.asarray(cluster.R_PG0[j]) @ Rotation.from_rotvec([0, 0, gamma[j]]).as_matrix()
        r = np.asarray(cluster.p_PC_P[j]) + G @ np.asarray(cluster.p_CR_G[j])
        force, torque = G @ force, G @ torque
        expected = np.concatenate([force, torque + np.cross(r, force)])
        assert found[j] == pytest.approx(expected, rel=1e-12, abs=1e-12)


@pytest.fixture(scope="module")
def rocking():
    """A tilting rotor as a real system: state (tilt about y, z, rates), torques in and out."""
    zeta, natural, speed = 0.03, 2 * np.pi * 60.0, 200 * np.pi
    k, c = ACROSS * natural**2, 2 * zeta * natural * ACROSS
    # dH/dt = I_t tilt'' + I_s Omega (z rate, -y rate): docs/theory.md, section 15
    gyro = SPIN * speed * np.array([[0.0, 1.0], [-1.0, 0.0]])
    A = np.block(
        [
            [np.zeros((2, 2)), np.eye(2)],
            [-k / ACROSS * np.eye(2), -(c * np.eye(2) + gyro) / ACROSS],
        ]
    )
    B = np.vstack([np.zeros((2, 2)), np.eye(2) / ACROSS])
    C = np.hstack([k * np.eye(2), c * np.eye(2)])
    return zeta, natural, speed, A, B, C


def test_rocking_is_the_response_of_the_four_state_matrix(rocking):
    zeta, natural, _, A, B, C = rocking
    shaking = disturbance(period=(0, 0, 1 / natural), damping=(1, 1, zeta))
    cluster = paper_satellite().clusters[0].units
    omega = np.linspace(-700.0, 1500.0, 12)
    found = shaking.transmission(
        cluster, cluster.rotor_speed, jnp.tile(jnp.array(omega)[:, None], (1, 4))
    )
    for w, passed in zip(omega, np.asarray(found), strict=True):
        transfer = C @ np.linalg.solve(1j * w * np.eye(4) - A, B)
        for channel, vector in ((3, [1, -1j]), (4, [1, 1j])):
            assert transfer @ vector == pytest.approx(passed[0, channel] * np.array(vector))
        assert passed[0, [0, 1, 2, 5]] == pytest.approx(1.0)  # what has no mode passes whole


def test_whirl_frequencies_are_the_eigenvalues_and_the_published_split(rocking):
    """Undamped: w = +-q + sqrt(q^2 + w0^2), q = I_s Omega / (2 I_t) (Masterson 1999)."""
    _, natural, speed, A, _, C = rocking
    undamped = A - np.block([[np.zeros((2, 4))], [np.zeros((2, 2)), -C[:, 2:] / ACROSS]])
    q = SPIN * speed / (2 * ACROSS)
    split = np.sqrt(q**2 + natural**2) + q * np.array([-1.0, 1.0])
    eigenvalues = np.linalg.eigvals(undamped)
    assert np.sort(np.abs(eigenvalues)) == pytest.approx(np.sort(np.tile(split, 2)))
    # the transmission is largest there: backward at the lower one, forward at the higher one
    shaking = disturbance(period=(0, 0, 1 / natural), damping=(1, 1, 1e-4))
    cluster = paper_satellite().clusters[0].units
    at = np.linspace(1.0, 1.5 * split[1], 200_001)
    passed = shaking.transmission(
        cluster, cluster.rotor_speed, jnp.tile(jnp.array(at)[:, None], (1, 4))
    )
    for channel, whirl in ((4, split[0]), (3, split[1])):
        peak = at[np.argmax(np.abs(np.asarray(passed[:, 0, channel])))]
        assert peak == pytest.approx(whirl, rel=1e-4)


def test_translation_is_the_second_order_form_of_the_books():
    """Zhang and Xu (2012), eq. 2: at sqrt(2) of the resonance all pass 1, whatever the damping."""
    shaking = disturbance(period=(1 / 300.0, 1 / 500.0, 0), damping=(0.1, 0.5, 0.02))
    cluster = paper_satellite().clusters[0].units
    omega = 300.0 * np.array([0.5, 1.0, np.sqrt(2.0), 3.0])
    passed = np.asarray(
        shaking.transmission(cluster, cluster.rotor_speed, jnp.outer(jnp.array(omega), jnp.ones(4)))
    )
    for channel, natural, xi in ((0, 300.0, 0.1), (1, 300.0, 0.1), (2, 500.0, 0.5)):
        r = omega / natural
        size = np.sqrt((1 + 4 * xi**2 * r**2) / ((1 - r**2) ** 2 + 4 * xi**2 * r**2))
        assert np.abs(passed[:, 0, channel]) == pytest.approx(size)
        assert np.all(np.angle(passed[:, 0, channel]) < 0.0)  # lags
    assert abs(passed[2, 0, 0]) == pytest.approx(1.0)


@pytest.mark.parametrize("logarithmic", [True, False])
def test_spectra_are_straight_between_points_and_nothing_outside(logarithmic):
    spectrum = Spectrum(jnp.array([10.0, 40.0, 90.0]), jnp.array([1.0, 16.0, 4.0]), logarithmic)
    middle = 4.0 if logarithmic else 1.0 + 15.0 / 3.0  # psd ~ f^2 there
    found = spectrum.density(jnp.array([9.9, 10.0, 20.0, 90.0, 90.1]))
    assert np.asarray(found) == pytest.approx([0.0, 1.0, middle, 4.0, 0.0])


def test_noise_between_knots_is_the_spline_of_degree_five():
    """SciPy's periodic spline through the same samples."""
    rng = np.random.default_rng(3)
    t, y = np.arange(41) / 50.0, rng.normal(size=(41, 4, 6))
    y[-1] = y[0]
    known = make_interp_spline(t, y, k=5, bc_type="periodic")
    # coefficients from samples: the basis spline sampled is a circulant matrix
    row = np.zeros(40)
    row[[-2, -1, 0, 1, 2]] = np.array([1, 26, 66, 26, 1]) / 120
    circulant = np.stack([np.roll(row, i) for i in range(40)])
    coefficients = np.linalg.solve(circulant, y[:40].reshape(40, -1)).reshape(40, 4, 6)
    noise = Noise(jnp.array(50.0), jnp.array(coefficients))
    for at in (0.0, 0.0137, 0.5, 0.793):
        assert np.asarray(noise.at(jnp.array(at))) == pytest.approx(known(at), abs=1e-9)
    assert np.asarray(noise.at(jnp.array(0.8 + 0.0137))) == pytest.approx(known(0.0137), abs=1e-9)


def test_a_realisation_has_the_spectra_of_its_tables():
    """Welch's estimate, and the whole mean square; resonances shape it; seeds tell apart."""
    table = Spectrum(jnp.array([5.0, 50.0]), jnp.array([2.0, 0.5]), False)
    of_each = ((table, None, None, table),) * 4
    shaken = disturbance(broadband=of_each, period=(1 / 200.0, 0, 0))
    satellite = with_cluster(paper_satellite(), disturbance=shaken)
    first, again = (with_noise(satellite, seeds, 40.0) for seeds in ((1, 2, 3, 4), (1, 2, 3, 5)))
    t = np.arange(40 * 400) / 400.0
    noise = first.clusters[0].disturbance.noise
    signal = np.asarray(jnp.stack([noise.at(u) for u in t[:3]]))
    samples = np.fft.fft(np.asarray(noise.coefficients), axis=0)  # evaluated fast, at the knots
    n = len(samples)
    angle = 2 * np.pi * np.fft.fftfreq(n)
    basis = (66 + 52 * np.cos(angle) + 2 * np.cos(2 * angle)) / 120
    knots = np.fft.ifft(samples * basis[:, None, None], axis=0).real
    assert float(noise.rate) * 40.0 == pytest.approx(n)
    assert knots[0] == pytest.approx(signal[0], abs=1e-9)
    f, psd = welch(knots, float(noise.rate), nperseg=n // 20, axis=0)
    inside = (f > 6.0) & (f < 48.0)
    density = np.interp(f, [5.0, 50.0], [2.0, 0.5])[:, None]
    about = psd[inside][:, :, 3] / density[inside]  # axial torque, along s
    assert about.mean() == pytest.approx(1.0, abs=0.03)
    assert psd[f > 60.0].max() < 1e-6
    r = 2 * np.pi * f / 200.0
    shaped = (1 + 4 * 0.02**2 * r**2) / ((1 - r**2) ** 2 + 4 * 0.02**2 * r**2)
    smooth = inside & (np.abs(r - 1) > 0.2)  # the peak is narrower than Welch's window
    for axis in (1, 2):  # both axes across
        about = psd[smooth][:, :, axis] / (density * shaped[:, None])[smooth]
        assert about.mean() == pytest.approx(1.0, abs=0.06)
    across = np.corrcoef(knots[:, 0, 1], knots[:, 0, 2])[0, 1]
    assert abs(across) < 0.2  # independent
    square = np.mean(knots[:, :, 3] ** 2, axis=0)
    assert square == pytest.approx(0.5 * (2.0 + 0.5) * 45.0, rel=1e-2)  # area of the table
    same = np.all(
        np.asarray(noise.coefficients == again.clusters[0].disturbance.noise.coefficients), (0, 2)
    )
    assert list(same) == [True, True, True, False]


def test_noise_without_a_realisation_is_refused():
    table = Spectrum(jnp.array([5.0, 50.0]), jnp.array([2.0, 0.5]), False)
    noisy = disturbance(broadband=((table, None, None, None),) * 4)
    cluster = paper_satellite().clusters[0].units
    with pytest.raises(ValueError, match="needs a realisation"):
        noisy.wrench(cluster, jnp.zeros(()), jnp.zeros(4), cluster.rotor_speed)
