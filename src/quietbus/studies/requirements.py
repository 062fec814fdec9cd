"""Metric and stretch of a pointing requirement, and whether a run can judge it."""

from typing import Any

from quietbus.analysis.pointing.metrics import check_stretch
from quietbus.analysis.pointing.windows import MOST_PERIODS, Metric
from quietbus.methods import Method
from quietbus.results import aliasing
from quietbus.scenario import Problem, Scenario, ScenarioError
from quietbus.scenario.control import NoSteering
from quietbus.studies.image_motion import RIPPLE

JUDGED = 0.1  # share of a run, its last part, that is judged unless a requirement says otherwise


def metric_of(requirement: Any) -> Metric:
    fields = {
        name: getattr(requirement, name, 0.0)
        for name in ("window", "tau", "above", "spatial_frequency")
    }
    if hasattr(requirement, "middle_to_middle"):
        fields["tau"] = requirement.middle_to_middle
    return Metric(requirement.metric, **fields)


def stretch_of(requirement: Any, last: float) -> tuple[float, float]:
    """What is judged of a run from 0 to ``last`` [s]."""
    end = last if requirement.end is None else requirement.end
    start = requirement.start
    return (max(0.0, end - JUDGED * last) if start is None else start), end


def check_requirements(scenario: Scenario, method: Method | type[Method], last: float) -> None:
    """Refuse requirements that a run from 0 to ``last`` [s] cannot judge, before it is made.

    Raises:
        ScenarioError: windows longer than the stretch that is judged, a stretch outside the run, or
            an output rate of a direct run that shows too little.
    """
    problems = []
    nyquist = 0.5 * scenario.simulation.output_rate
    too_coarse = "" if method.jitter_apart else aliasing(scenario)
    if too_coarse:
        text = f"{too_coarse}. Use method 'harmonic', or raise simulation.output_rate"
        problems.append(Problem(text, ("requirements",)))
    if method.jitter_apart and scenario.units.ripple and _gimbals_move(scenario):
        problems.append(Problem(RIPPLE, ("requirements",)))
    highest = _highest_noise(scenario) if method.jitter_apart else 0.0
    for i, requirement in enumerate(scenario.requirements):
        metric = metric_of(requirement)
        if metric.span * highest > MOST_PERIODS:
            text = (
                f"expected a window (and tau) of at most {MOST_PERIODS / highest:.4g} s, in which "
                f"broadband noise up to {highest:g} Hz can be integrated over; got "
                f"{metric.span:g} s. Use method 'direct'"
            )
            problems.append(Problem(text, ("requirements", i, "window")))
        try:
            check_stretch(0.0, last, metric, stretch_of(requirement, last))
        except ValueError as error:
            problems.append(Problem(str(error), ("requirements", i)))
        if not method.jitter_apart and metric.above >= nyquist:
            text = (
                f"expected less than {nyquist:g} Hz, half the output rate; got {metric.above:g} Hz"
            )
            problems.append(Problem(text, ("requirements", i, "above")))
    if problems:
        raise ScenarioError(scenario.name, problems)


def _gimbals_move(scenario: Scenario) -> bool:
    control = scenario.control
    return control is not None and not isinstance(control.steering, NoSteering)


def _highest_noise(scenario: Scenario) -> float:
    """Highest frequency [Hz] of the rotors' broadband disturbance; 0 without."""
    ends = [
        spectrum.frequency[-1]
        for unit in scenario.units.placed()
        if unit.rotor and unit.rotor.disturbance
        for spectrum in unit.rotor.disturbance.broadband.given().values()
    ]
    return max(ends, default=0.0)
