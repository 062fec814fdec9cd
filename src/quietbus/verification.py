"""Pointing requirements of a scenario against what a run of it shows (``quietbus verify``)."""

from dataclasses import dataclass
from functools import cached_property
from importlib.metadata import version
from typing import Any

import numpy as np
import xarray as xr
from scipy.spatial.transform import Rotation

from quietbus.analysis.channels import json_ready
from quietbus.analysis.motion import ImageMotion, Lines, SampledSignal
from quietbus.analysis.pointing import Statistic, check_stretch, contributions, evaluate
from quietbus.analysis.windows import Metric
from quietbus.results import aliasing, scenario_of
from quietbus.scenario import Problem, Scenario, ScenarioError

ARCSEC = np.rad2deg(1.0) * 3600.0
JUDGED = 0.1  # share of a run, its last part, that is judged unless a requirement says otherwise
CURVE = 17  # exposure times
CURVE_EFFORT = 0.1
NOTHING = 1e-9  # of all: lines that are left out of the contributions


@dataclass(frozen=True)
class Verdict:
    """One requirement and what the run makes of it; angles in rad."""

    name: str  # short, with its windows: ``RPE 5 ms``
    line_of_sight: str
    metric: Metric
    statistic: Statistic
    meaning: str  # of the value, in words
    stretch: tuple[float, float]  # [s] judged
    value: float  # [rad], or a plain number of MTF_loss
    limit: float
    contributions: dict[str, float]  # [rad] RMS that each alone has in the metric

    @property
    def met(self) -> bool:
        """Whether the value is at most the limit."""
        return self.value <= self.limit

    @property
    def margin(self) -> float:
        """What is left to the limit, negative if it is exceeded."""
        return self.limit - self.value

    @property
    def margin_percent(self) -> float:
        """The same in percent of the limit."""
        return 100.0 * self.margin / self.limit

    @property
    def unit(self) -> str:
        """Of ``shown``."""
        return "1" if self.metric.name == "MTF_loss" else "arcsec"

    @property
    def scale(self) -> float:
        """Of values in ``unit`` by those in SI."""
        return 1.0 if self.unit == "1" else ARCSEC

    def shown(self, value: float) -> float:
        """A value in ``unit``."""
        return self.scale * value


@dataclass(frozen=True)
class Verification:
    """The pointing requirements of a run's scenario.

    Of a harmonic run each value is of slow motion and lines together, over all rotor phases if the
    requirement does not say otherwise. A direct run is the only member of its ensemble.

    Raises:
        ScenarioError: requirements that the run cannot judge (``check_requirements``).
    """

    run: xr.Dataset

    def __post_init__(self) -> None:
        time = self.run["time"].to_numpy()
        check_requirements(self.scenario, self.run.attrs["method"], float(time[-1]))

    @cached_property
    def scenario(self) -> Scenario:
        """As it was run."""
        return scenario_of(self.run)

    @cached_property
    def _motions(self) -> dict[str, ImageMotion]:
        return {name: image_motion(self.run, name) for name in self.scenario.lines_of_sight}

    def motion(self, line_of_sight: str) -> ImageMotion:
        """Image motion of a line of sight [rad]."""
        return self._motions[line_of_sight]

    @cached_property
    def verdicts(self) -> tuple[Verdict, ...]:
        """In the order of the scenario."""
        return tuple(self._verdict(requirement) for requirement in self.scenario.requirements)

    def _verdict(self, requirement: Any) -> Verdict:
        last = float(self.run["time"][-1])
        metric, stretch = _metric(requirement), _stretch(requirement, last)
        motion = self._judged(requirement)
        statistic = Statistic(
            requirement.confidence, requirement.interpretation, requirement.rotor_phases
        )
        parts = contributions(motion, metric, stretch)
        least = NOTHING * np.linalg.norm(list(parts.values()))
        return Verdict(
            name=_name(metric),
            line_of_sight=requirement.line_of_sight,
            metric=metric,
            statistic=statistic,
            meaning=_meaning(metric, statistic, motion),
            stretch=stretch,
            value=evaluate(motion, metric, stretch, statistic),
            limit=requirement.at_most,
            contributions={name: rms for name, rms in parts.items() if rms > least},
        )

    def _judged(self, requirement: Any) -> ImageMotion:
        motion = self.motion(requirement.line_of_sight)
        return motion if requirement.component is None else motion.component(requirement.component)

    @property
    def met(self) -> bool:
        """Whether all requirements are."""
        return all(verdict.met for verdict in self.verdicts)

    def curve(self, i: int) -> tuple[np.ndarray, np.ndarray] | None:
        """Requirement i's metric [rad, or 1] against exposure time [s]; None if it has no window.

        From a thirtieth to thirty times its window, as far as the judged stretch goes.
        """
        verdict = self.verdicts[i]
        metric = verdict.metric
        if not metric.window:
            return None
        motion = self._judged(self.scenario.requirements[i])
        start, end = verdict.stretch
        longest = end - start - (metric.span - metric.window)
        windows = np.geomspace(metric.window / 30.0, min(30.0 * metric.window, longest), CURVE)
        values = [
            evaluate(
                motion, metric.with_window(T), verdict.stretch, verdict.statistic, CURVE_EFFORT
            )
            for T in windows
        ]
        return windows, np.array(values)

    def to_dict(self) -> dict[str, Any]:
        """For JSON; see docs/pointing.md."""
        return json_ready(
            {
                "scenario": self.scenario.name,
                "version": version("quietbus"),
                "mount": self.run.attrs["mount"],
                "method": self.run.attrs["method"],
                "met": self.met,
                "requirements": [
                    {
                        "metric": verdict.metric.name,
                        "line_of_sight": verdict.line_of_sight,
                        "name": verdict.name,
                        "meaning": verdict.meaning,
                        "from_s": verdict.stretch[0],
                        "until_s": verdict.stretch[1],
                        "unit": verdict.unit,
                        "value": verdict.shown(verdict.value),
                        "limit": verdict.shown(verdict.limit),
                        "margin": verdict.shown(verdict.margin),
                        "margin_percent": verdict.margin_percent,
                        "met": verdict.met,
                        "contributions_arcsec": {
                            name: ARCSEC * rms for name, rms in verdict.contributions.items()
                        },
                    }
                    for verdict in self.verdicts
                ],
            }
        )


def _metric(requirement: Any) -> Metric:
    fields = ("window", "tau", "above", "spatial_frequency")
    return Metric(requirement.metric, *(getattr(requirement, name, 0.0) for name in fields))


def _stretch(requirement: Any, last: float) -> tuple[float, float]:
    """What is judged of a run from 0 to ``last`` [s]."""
    end = last if requirement.end is None else requirement.end
    start = requirement.start
    return (max(0.0, end - JUDGED * last) if start is None else start), end


def check_requirements(scenario: Scenario, method: str, last: float) -> None:
    """Refuse requirements that a run from 0 to ``last`` [s] cannot judge, before it is made.

    Raises:
        ScenarioError: windows longer than the stretch that is judged, a stretch outside the run, or
            an output rate of a direct run that shows too little.
    """
    problems = []
    nyquist = 0.5 * scenario.simulation.output_rate
    too_coarse = "" if method == "harmonic" else aliasing(scenario)
    if too_coarse:
        text = f"{too_coarse}. Use method 'harmonic', or raise simulation.output_rate"
        problems.append(Problem(text, ("requirements",)))
    for i, requirement in enumerate(scenario.requirements):
        metric = _metric(requirement)
        try:
            check_stretch(0.0, last, metric, _stretch(requirement, last))
        except ValueError as error:
            problems.append(Problem(str(error), ("requirements", i)))
        if method != "harmonic" and metric.above >= nyquist:
            text = (
                f"expected less than {nyquist:g} Hz, half the output rate; got {metric.above:g} Hz"
            )
            problems.append(Problem(text, ("requirements", i, "above")))
    if problems:
        raise ScenarioError(scenario.name, problems)


def _name(metric: Metric) -> str:
    """``PDE 5 ms, tau 1 s``."""
    parts = []
    if metric.window:
        parts.append(_time(metric.window))
    if metric.tau:
        parts.append(f"tau {_time(metric.tau)}")
    if metric.above:
        parts.append(f"above {metric.above:g} Hz")
    if metric.spatial_frequency:
        parts.append(f"{metric.spatial_frequency / ARCSEC:.4g}/arcsec")
    return f"{metric.name} {', '.join(parts)}".strip()


def _time(seconds: float) -> str:
    return f"{seconds:g} s" if seconds >= 1.0 else f"{1e3 * seconds:g} ms"


def _meaning(metric: Metric, statistic: Statistic, motion: ImageMotion) -> str:
    """What the value is, in words."""
    given = motion.lines is None or statistic.phases == "given"
    phases = "rotor phases as given" if given else "any rotor phases"
    if statistic.confidence is None:
        mean = "mean" if metric.name == "MTF_loss" else "RMS"
        return f"{mean} over time, {phases}"
    level = f"{100.0 * statistic.confidence:.6g} %"
    match statistic.interpretation, given:
        case "temporal", False:
            return f"{level} of the time for the worst rotor phases (temporal)"
        case "ensemble", False:
            return f"always, for {level} of all rotor phases (ensemble)"
        case "mixed", False:
            return f"{level} of all times and rotor phases (mixed)"
        case "ensemble", True:
            return f"always, {phases} (ensemble of one member)"
        case _:
            return f"{level} of the time, {phases} ({statistic.interpretation})"


def image_motion(run: xr.Dataset, name: str) -> ImageMotion:
    """Image motion of a line of sight of the run's scenario [rad].

    The signal is the error against the commanded attitude, the whole of it of a direct run and its
    slow part of a harmonic one, whose lines come beside it.

    Raises:
        ValueError: the scenario has no such line of sight.
    """
    scenario = scenario_of(run)
    if name not in scenario.lines_of_sight:
        known = ", ".join(scenario.lines_of_sight) or "none"
        raise ValueError(f"line of sight: expected one of {known}; got {name!r}")
    line = scenario.lines_of_sight[name]
    time = run["time"].to_numpy()
    signal = SampledSignal(time, _errors(run, scenario) @ (line.image() @ line.matrix()).T)
    if run.attrs["method"] != "harmonic":
        return ImageMotion(signal)
    amplitude, shift = (
        run[f"line_of_sight_jitter_{part}"]
        .sel(line=name)
        .transpose("time", "cmg", "order", "axis")
        .to_numpy()
        for part in ("amplitude", "phase")
    )
    image = (amplitude * np.exp(1j * shift)) @ line.image().T
    orders = run["order"].to_numpy()
    units = scenario.cluster.placed()
    speed = np.array([unit.rotor.speed if unit.rotor else 0.0 for unit in units])
    phase = np.array(scenario.cluster.rotor_phases or np.zeros(len(units)))
    lines = Lines(
        amplitude=image.reshape(len(time), -1, image.shape[-1]),
        frequency=np.outer(speed, orders).ravel(),
        phase=np.outer(phase, orders).ravel(),
        rotor=np.repeat(np.arange(len(units)), len(orders)),
        order=np.tile(orders, len(units)),
    )
    return ImageMotion(signal, lines)


def _errors(run: xr.Dataset, scenario: Scenario) -> np.ndarray:
    """(n, 12) motions in the order of a sensitivity's columns, along bus axes."""
    bus, plate = (
        Rotation.from_quat(run[f"{body}_attitude"].to_numpy(), scalar_first=True)
        for body in ("bus", "platform")
    )
    p_NB, p_NP = (run[f"{body}_position"].to_numpy() for body in ("bus", "platform"))
    isolator = scenario.isolator
    base = Rotation.from_euler("ZYX", isolator.orientation[::-1])
    place = isolator.offset + base.apply([0.0, 0.0, isolator.separation])
    return np.hstack(
        [
            run["attitude_error"].to_numpy(),
            bus.inv().apply(p_NB),
            (bus.inv() * plate * base.inv()).as_rotvec(),
            bus.inv().apply(p_NP - p_NB) - place,
        ]
    )
