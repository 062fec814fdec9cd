# ruff: noqa: E501 (a mistake and its message on one line)
"""Lines of sight and requirements in a scenario: what is read, and every refusal with its field."""

import numpy as np
import pytest
from scipy.stats import norm

from quietbus.analysis.pointing.windows import METRICS
from quietbus.scenario import LineOfSight, Scenario, ScenarioError, load_scenario
from quietbus.scenario.pointing import _FORMS

TEXT = load_scenario("zhang2012").to_yaml().replace("lines_of_sight: {}\n", "")
TEXT = TEXT.replace("requirements: []\n", "")
CAMERA = "lines_of_sight: {camera: {direction: [0, 0, -1]}, flat: {sensitivity: [[1, 0, 0, 0, 0, 0, 0, 0, 0, 0, 0, 0]]}}\n"


def read(requirement: str) -> Scenario:
    return Scenario.from_yaml(f"{TEXT}{CAMERA}requirements:\n- {requirement}\n", "s.yaml")


def refusal(text: str) -> str:
    with pytest.raises(ScenarioError) as error:
        Scenario.from_yaml(TEXT + text, "s.yaml")
    return str(error.value)


def test_short_and_long_form_are_the_same():
    short = read(
        "PDE(camera, window = 5 ms, tau = 2 s, confidence = 0.997, component = 1) <= 0.1 arcsec"
    )
    long = read(
        "{metric: PDE, line_of_sight: camera, window: 5 ms, tau: 2, confidence: 99.7 %, "
        "component: 1, at_most: 0.1 arcsec}"
    )
    assert short == long
    (requirement,) = long.requirements
    assert requirement.at_most == pytest.approx(np.radians(0.1 / 3600))
    assert (requirement.window, requirement.interpretation) == (5e-3, "temporal")
    assert Scenario.from_yaml(long.to_yaml()) == long
    (other,) = read(
        "MTF_loss(camera, window=5 ms, spatial_frequency=0.5 1/arcsec) ≤ 5 %"
    ).requirements
    assert other.at_most == 0.05
    assert other.spatial_frequency == pytest.approx(0.5 * np.degrees(1) * 3600)


def test_every_metric_can_be_required():
    assert set(_FORMS) == set(METRICS)


def test_a_direction_is_seen_across():
    """What a small turn does to the unit vector, in two axes that are normal to it."""
    d = np.array([0.6, 0.0, 0.8])
    line = LineOfSight(direction=tuple(d))
    turn = np.array([1e-3, -2e-3, 5e-4])
    moved = line.matrix() @ np.concatenate([turn, np.ones(9)])
    assert moved == pytest.approx(np.cross(turn, d))
    assert np.linalg.norm(line.image() @ moved) == pytest.approx(np.linalg.norm(moved))
    assert line.image() @ d == pytest.approx([0, 0])


def test_separation_is_from_the_end_of_a_window_to_the_beginning_of_the_next():
    """As ECSS gives it; tau is from middle to middle."""
    (apart,) = read("PRE(camera, window = 5 ms, separation = 2 s) <= 1 arcsec").requirements
    (between,) = read("PRE(camera, window = 5 ms, tau = 2.005 s) <= 1 arcsec").requirements
    assert apart.middle_to_middle == pytest.approx(between.middle_to_middle)
    (adjacent,) = read("PDE(camera, window = 5 ms, separation = 0) <= 1 arcsec").requirements
    assert adjacent.middle_to_middle == 5e-3


REFUSED = [
    (
        "PDE(camera, window = 5 ms, tau = 4 ms) <= 1 arcsec",
        "requirements[0].tau (line {}): expected the window (0.005 s) or more, or the two windows overlap; got 0.004 s. windowed_stability may overlap",
    ),
    (
        "PDE(camera, window = 5 ms, tau = 6 ms, separation = 1 ms) <= 1 arcsec",
        "requirements[0] (line {}): expected one of tau and separation, got tau and separation",
    ),
    (
        "stability(camera, window = 5 ms, tau = 6 ms) <= 1 arcsec",
        "requirements[0].window (line {}): stability is the change from one instant to another, tau later; of the means of windows it is windowed_stability",
    ),
    (
        "MKE(camera, window = 5 ms) <= 1 arcsec",
        "requirements[0].metric (line {}): MKE: an error of the attitude as known on board, which a scenario has no sensors for: the control knows the true attitude. Expected an error of pointing: APE, MPE, RPE",
    ),
    (
        "{metric: RPE, line_of_sight: camera, window: 5 m, at_most: 1}",
        "requirements[0].window (line {}): expected a time in s, got '5 m' (a length?)",
    ),
    (
        "{metric: RPE, line_of_sight: camera, window: 1, at_most: 1 m}",
        "requirements[0].at_most (line {}): expected an angle in rad, got '1 m' (a length?)",
    ),
    (
        "{metric: RPE, line_of_sight: camera, window: 1, at_most: 0}",
        "requirements[0].at_most (line {}): expected an angle in rad, got 0 (must be above 0)",
    ),
    (
        "{metric: MTF_loss, line_of_sight: camera, window: 1, spatial_frequency: 1, at_most: 1 arcsec}",
        "requirements[0].at_most (line {}): expected a plain number, got '1 arcsec' (an angle?)",
    ),
    (
        "{metric: MTF_loss, line_of_sight: camera, window: 1, spatial_frequency: 3 Hz, at_most: 1}",
        "requirements[0].spatial_frequency (line {}): expected a spatial frequency in 1/rad, got '3 Hz' (a frequency?)",
    ),
    (
        "{metric: RPEE, line_of_sight: camera}",
        "requirements[0].metric (line {}): expected one of APE, displacement, jitter, MPE, MTF_loss, PDE, PRE, rms, RPE, smear, stability, windowed_stability, got 'RPEE'",
    ),
    (
        "{line_of_sight: camera}",
        "requirements[0].metric (line {}): expected one of APE, displacement, jitter, MPE, MTF_loss, PDE, PRE, rms, RPE, smear, stability, windowed_stability, got nothing",
    ),
    (
        "{metric: APE, line_of_sight: telescope, at_most: 1}",
        "requirements[0].line_of_sight (line {}): expected one of camera, flat, got 'telescope'",
    ),
    (
        "{metric: APE, line_of_sight: flat, component: 1, at_most: 1}",
        "requirements[0].component (line {}): expected 0, the only image component of flat, got 1",
    ),
    (
        "{metric: APE, line_of_sight: camera, component: 2, at_most: 1}",
        "requirements[0].component (line {}): expected 0 or 1, an image component, got 2",
    ),
    (
        "{metric: APE, line_of_sight: camera, confidence: 1, at_most: 1}",
        "requirements[0].confidence (line {}): expected a confidence level between 0 and 1, got 1.0",
    ),
    (
        "{metric: APE, line_of_sight: camera, confidence: 0, at_most: 1}",
        "requirements[0].confidence (line {}): expected a confidence level between 0 and 1, got 0 (must be above 0)",
    ),
    (
        "{metric: APE, line_of_sight: camera, confidence: 120 %, at_most: 1}",
        "requirements[0].confidence (line {}): expected a confidence level between 0 and 1, got 1.2",
    ),
    (
        "{metric: APE, line_of_sight: camera, interpretation: never, at_most: 1}",
        "requirements[0].interpretation (line {}): expected 'ensemble', 'temporal' or 'mixed', got 'never'",
    ),
    (
        "{metric: APE, line_of_sight: camera, rotor_phases: any, at_most: 1}",
        "requirements[0].rotor_phases (line {}): expected 'random' or 'given', got 'any'",
    ),
    (
        "{metric: APE, line_of_sight: camera, window: 1, at_most: 1}",
        "requirements[0].window (line {}): unknown key 'window'; known here: line_of_sight,",
    ),
    (
        "{metric: PDE, line_of_sight: camera, window: 1, at_most: 1}",
        "requirements[0] (line {}): expected one of tau and separation, got neither",
    ),
    (
        "{metric: rms, line_of_sight: camera, at_most: 1}",
        "requirements[0].above (line {}): expected a frequency in Hz, got nothing",
    ),
    (
        "{metric: APE, line_of_sight: camera, start: 5, end: 4, at_most: 1}",
        "requirements[0].end (line {}): expected a time after start (5 s), got 4",
    ),
    (
        "'RPE(camera, window = 1 s, window = 2 s) <= 1 arcsec'",
        "requirements[0] (line {}): expected each key once, not window twice, got 'RPE(camera,",
    ),
    (
        "'RPE(camera, window = 1 s, metric = MPE) <= 1 arcsec'",
        "requirements[0] (line {}): expected each key once, not metric twice, got 'RPE(camera,",
    ),
    (
        "RPE of camera below 1",
        "requirements[0] (line {}): expected a mapping with the key metric, or a text like 'RPE(camera, window = 5 ms, confidence = 0.997) <= 0.1 arcsec', got 'RPE of camera below 1'",
    ),
]


@pytest.mark.parametrize(("requirement", "message"), REFUSED)
def test_wrong_requirements_are_refused(requirement, message):
    line = TEXT.count("\n") + 3
    assert message.replace("{}", str(line)) in refusal(f"{CAMERA}requirements:\n- {requirement}\n")


@pytest.mark.parametrize(
    ("lines", "message"),
    [
        (
            "{a: {}}",
            "lines_of_sight.a (line {}): expected one of direction and sensitivity, got neither",
        ),
        (
            "{a: {direction: [0, 0, 2]}}",
            "lines_of_sight.a.direction (line {}): expected a unit vector",
        ),
        (
            "{a: {sensitivity: [[1, 2]]}}",
            "lines_of_sight.a.sensitivity[0] (line {}): expected a list of 12 numbers, got [1, 2]",
        ),
        (
            "{a: {sensitivity: " + str([[1] * 12] * 3) + "}}",
            "lines_of_sight.a.sensitivity (line {}): expected one or two rows",
        ),
        (
            "{a: {sensitivity: " + str([[0] * 12]) + "}}",
            "lines_of_sight.a.sensitivity (line {}): expected a matrix that is not zero",
        ),
        ("{a: {view: 1}}", "unknown key 'view'"),
        (
            "[1]",
            "lines_of_sight (line {}): expected a mapping from names to lines of sight, got [1]",
        ),
    ],
)
def test_wrong_lines_of_sight_are_refused(lines, message):
    line = TEXT.count("\n") + 1
    assert message.replace("{}", str(line)) in refusal(f"lines_of_sight: {lines}\n")


def test_a_requirement_without_any_line_of_sight():
    said = refusal("requirements: [{metric: APE, line_of_sight: camera, at_most: 1}]\n")
    assert "expected a name under lines_of_sight, got 'camera'" in said


@pytest.mark.parametrize("text", ["3 sigma", "3σ", "3-sigma", "3.0 Sigma"])
def test_a_confidence_in_sigmas_is_the_probability_of_a_normal_variable(text):
    (requirement,) = read(
        f"RPE(camera, window = 5 ms, confidence = {text}) <= 1 arcsec"
    ).requirements
    assert requirement.confidence == pytest.approx(norm.cdf(3) - norm.cdf(-3), rel=1e-14)


@pytest.mark.parametrize(
    "text", ["sigma", "0 sigma", "-1 sigma", "nan sigma", "9 sigma", "a sigma"]
)
def test_sigmas_that_are_none_are_refused(text):
    with pytest.raises(ScenarioError, match=r"confidence.*expected a number of sigmas above 0"):
        read(f"RPE(camera, window = 5 ms, confidence = {text}) <= 1 arcsec")
