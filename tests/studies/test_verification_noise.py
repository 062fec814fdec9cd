"""`qb.verify` with broadband disturbance and ripple: both solvers, contributors, refusals."""

import numpy as np
import pytest
from scipy.signal import butter, sosfiltfilt

import quietbus as qb
from quietbus.analysis.pointing.contributors import powers
from quietbus.analysis.pointing.metrics import evaluate
from quietbus.analysis.pointing.motion import ImageMotion, SampledSignal
from quietbus.analysis.pointing.noise import Noise
from quietbus.plain import ARCSEC
from quietbus.plots.pointing import cumulative_spectrum
from quietbus.studies.image_motion import image_motion

NOISE = {
    "orders": [{"order": 1, "radial_force": "2e-6 kg*m"}],
    "broadband": {
        "radial_force": {"frequency": [80, 150, 250], "psd": ["1 N^2/Hz", 10, 50]},
        "axial_torque": {"frequency": [80, 250], "psd": [1e-2, "1 N^2*m^2/Hz"]},
    },
    "seed": 3,
}
OBLIQUE = {"sensitivity": [[1.0, 0.6, 0.2] + [0.0] * 9, [0.3, 1.0, -0.5] + [0.0] * 9]}
START, END = 0.7, 4.0  # [s]
ALL = [
    {"metric": "APE", "confidence": 0.9},
    {"metric": "MPE", "window": 4e-3},
    {"metric": "RPE", "window": 4e-3, "confidence": 0.9},
    {"metric": "PDE", "window": 4e-3, "tau": 13e-3, "confidence": 0.9},
    {"metric": "smear", "window": 4e-3, "confidence": 0.9},
    {"metric": "jitter", "window": 8e-3, "confidence": 0.9},
    {"metric": "rms", "above": 50.0},
    {"metric": "MTF_loss", "window": 4e-3, "spatial_frequency": 2e7, "confidence": 0.9},
]
GIVEN = {"line_of_sight": "camera", "rotor_phases": "given", "at_most": 1e-3}


def scenario(requirements, **overrides):
    data = qb.load_scenario("zhang2012").to_dict()
    data["lines_of_sight"] = {"camera": OBLIQUE}
    data["requirements"] = requirements
    return qb.Scenario.from_dict(data).with_overrides(
        {
            "cluster.rotor.disturbance": NOISE,
            "initial": {"attitude": [0, 0, 0], "steady": True},
            "simulation": {"duration": END, "output_rate": 1000.0},
            **overrides,
        }
    )


@pytest.fixture(scope="module")
def both():
    asked = scenario([{**GIVEN, **each, "start": START, "end": END} for each in ALL])
    return {
        "harmonic": qb.verify(asked, output_rate=20.0),
        "direct": qb.verify(asked, method="direct"),
    }


def without_transient(motion):
    """Above 30 Hz: the noise's sudden beginning sets the bus adrift and the platform swinging.

    The steady response has neither; its band begins at 80 Hz.
    """
    signal = motion.signal
    high = butter(6, 30.0, "highpass", fs=signal.rate, output="sos")
    return ImageMotion(SampledSignal(signal.time, sosfiltfilt(high, signal.values, axis=0)))


def noise_of(verification):
    return verification.motion("camera").noise


@pytest.mark.parametrize("i", range(len(ALL)), ids=[each["metric"] for each in ALL])
def test_harmonic_and_direct_runs_agree_with_noise(both, i):
    """Within four standard deviations of a mean square over the stretch."""
    noise = noise_of(both["harmonic"])
    S, f = np.trace(noise.density[-1].sum(axis=1), axis1=1, axis2=2), noise.frequency
    spread = np.sqrt(np.trapezoid(S**2, f) / (END - START)) / np.trapezoid(S, f)  # of the square
    assert spread < 0.15
    verdict = both["harmonic"].verdicts[i]
    motion = without_transient(both["direct"].motion("camera"))
    value = evaluate(motion, verdict.metric, (START, END - 0.1), verdict.statistic)
    assert verdict.value == pytest.approx(value, rel=2.0 * spread + 0.02)
    parts = verdict.contributions
    lines = [value for name, value in parts.items() if "Ω" in name]
    assert np.linalg.norm(lines) < 0.5 * np.linalg.norm(list(parts.values()))


def test_image_covariance_is_that_of_the_direct_run(both):
    """Components across an oblique direction: their correlation needs the co-spectra."""
    noise = noise_of(both["harmonic"])
    found = np.trapezoid(noise.density[-1].sum(axis=1), noise.frequency, axis=0)
    signal = without_transient(both["direct"].motion("camera")).signal
    in_time = signal.mean_square_above(10.0, START, END)
    lines = both["harmonic"].motion("camera").lines
    z = lines.together((lines.amplitude[-1] * np.exp(1j * lines.phase)[:, None])[None])[0]
    in_time = in_time - 0.5 * (z.T @ z.conj()).real
    size = np.trace(in_time)
    assert abs(found[0, 1]) > 0.15 * size
    assert np.abs(found - in_time) / size == pytest.approx(np.zeros((2, 2)), abs=0.12)


def test_contributors_and_picture_name_the_rotors_noise(both):
    verdict = both["harmonic"].verdicts[6]
    names = [f"rotor {j}, broadband" for j in range(4)]
    assert set(names) <= set(verdict.contributions)
    squares = sum(verdict.contributions[name] ** 2 for name in names)
    run = both["harmonic"].run
    at = run["line_of_sight_psd"].isel(look=-1).sum(("cmg", "axis")).squeeze("line")
    above = at.sel(frequency=slice(50.0, None))
    assert squares == pytest.approx(np.trapezoid(above, above["frequency"]), rel=5e-3)
    figure = cumulative_spectrum("", powers(both["harmonic"].motion("camera"), (START, END)))
    said = [text.get_text() for text in figure.legends[0].get_texts()]
    assert set(names) <= set(said)
    curve = next(line for line in figure.axes[0].lines if line.get_label() == names[0])
    alone = run["line_of_sight_psd"].isel(look=-1, cmg=0).sum("axis").squeeze("line")
    total = np.sqrt(np.trapezoid(alone, alone["frequency"]))
    assert np.max(curve.get_ydata()) == pytest.approx(ARCSEC * total, rel=1e-2)


def test_a_verdict_hangs_on_the_noise(both):
    """A limit between what lines alone and lines with noise have."""
    run = both["harmonic"].run
    motion = image_motion(run, "camera")
    limit = 0.999 * both["harmonic"].verdicts[0].value
    tight = scenario([{**GIVEN, **ALL[0], "start": START, "end": END, "at_most": limit}])
    again = qb.Verification(run.assign_attrs(scenario=tight.to_yaml()))
    assert not again.met
    assert again.verdicts[0].margin < 0.0
    silent = run.drop_vars([name for name in run.variables if name.startswith("line_of_sight_psd")])
    assert image_motion(silent, "camera").noise is None
    assert motion.noise is not None
    assert qb.Verification(silent.assign_attrs(scenario=tight.to_yaml())).met


@pytest.mark.parametrize(
    ("changes", "method", "said"),
    [
        (
            {"cluster.gimbal_motor": {"ripple": [{"per_turn": 60, "torque": "1 mN*m"}]}},
            "harmonic",
            "requirements: the lines that cluster.gimbal_motor makes .* Use method 'direct'",
        ),
        (
            {"simulation.duration": 9000.0},
            "harmonic",
            r"requirements\[0\].window: expected a window \(and tau\) of at most 2000 s, in which "
            "broadband noise up to 250 Hz",
        ),
    ],
)
def test_what_noise_and_ripple_do_not_allow_is_refused_before_the_run(changes, method, said):
    window = "3000 s" if "simulation.duration" in changes else "1 ms"
    asked = scenario([f"RPE(camera, window = {window}, start = 0) <= 1"], **changes)
    with pytest.raises(qb.ScenarioError, match=said):
        qb.verify(asked, method)


RED = {
    "requirements": [
        f"jitter(camera, window = {window} ms, confidence = {level}{more}) <= 1e-4 arcsec"
        for window in (10, 20, 200)
        for level in (0.5, 0.997)
        for more in ("", ", interpretation = mixed", ", component = 0")
    ]
    + [f"jitter(camera, window = {window} ms) <= 1e-4 arcsec" for window in (10, 20, 200)],
}


def red_noise(both):
    """A torque's density over the inertia squared and f^4, as a free satellite has it."""
    run = both["harmonic"].run
    motion = image_motion(run, "camera")
    f = np.geomspace(1.0, 1000.0, 300)
    density = np.tile((1e-16 / f**4)[None, :, None, None, None] * np.eye(2), (2, 1, 1, 1, 1))
    noise = Noise(np.array([0.0, END]), f, density, ("rotor 0, broadband",))
    return ImageMotion(motion.signal, motion.lines, noise)


def test_no_statistic_of_jitter_is_next_to_nothing_beside_red_noise(both, monkeypatch):
    """Quantiles came to zero, and "met", where the RMS was above the limit: most of the noise's
    power lies below what a window sees."""
    asked = scenario(RED["requirements"])
    monkeypatch.setattr("quietbus.studies.verification.image_motion", lambda *_: red_noise(both))
    verification = qb.Verification(both["harmonic"].run.assign_attrs(scenario=asked.to_yaml()))
    rms = {
        v.metric.window: v.value for v in verification.verdicts if v.statistic.confidence is None
    }
    heard = []
    verification.judge(progress=lambda what, share: heard.append((what, share)))
    assert heard[0] == ("judging jitter 10 ms", 0.0)
    assert heard[-1] == ("judged", 1.0)
    for verdict in verification.verdicts[:-3]:
        least = 0.25 if verdict.statistic.confidence == 0.5 else 0.7
        assert least * rms[verdict.metric.window] < verdict.value < 5.0 * rms[verdict.metric.window]
    assert not verification.met
