"""Pointing requirements of a scenario against what a run of it shows (``quietbus verify``)."""

from collections.abc import Callable
from dataclasses import dataclass, field
from functools import cached_property
from importlib.metadata import version
from typing import Any

import numpy as np
import xarray as xr
from scipy.spatial.transform import Rotation

from quietbus.analysis.pointing.chi_square import UnsoundStatisticError
from quietbus.analysis.pointing.metrics import Statistic, check_stretch, contributions, evaluate
from quietbus.analysis.pointing.motion import ImageMotion, Lines, SampledSignal
from quietbus.analysis.pointing.noise import Noise
from quietbus.analysis.pointing.windows import MOST_PERIODS, Metric, largest_change
from quietbus.arguments import choice, count
from quietbus.methods import Method
from quietbus.plain import json_ready
from quietbus.results import AXES, aliasing, method_of, scenario_of
from quietbus.scenario import Problem, Scenario, ScenarioError
from quietbus.scenario.control import NoSteering

ARCSEC = np.rad2deg(1.0) * 3600.0
JUDGED = 0.1  # share of a run, its last part, that is judged unless a requirement says otherwise
RIPPLE = (
    "the lines that cluster.gimbal_motor makes have the frequency of the gimbals' rates, which "
    "changes: a harmonic run cannot judge them. Use method 'direct', or take gimbal_motor out to "
    "judge the rest"
)
STEADY = 0.02  # relative change of a rotor's speed that counts as none
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
    uncertainty: float = 0.0  # [rad, or 1] as much as the value may be off while modes still ring

    @property
    def met(self) -> bool:
        """Whether the value is at most the limit, for certain."""
        return self.value + self.uncertainty <= self.limit

    @property
    def decided(self) -> bool:
        """Whether the value is further from the limit than it may be off."""
        return self.met or self.value - self.uncertainty > self.limit

    @property
    def word(self) -> str:
        """The verdict."""
        return "met" if self.met else "NOT MET" if self.decided else "UNDECIDED"

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

    Of a harmonic run each value is of slow motion, lines and noise together, over all rotor phases
    if the requirement does not say otherwise. A direct run is the only member of its ensemble.

    Raises:
        ScenarioError: requirements that the run cannot judge (``check_requirements``).
    """

    run: xr.Dataset
    _found: dict[Any, Any] = field(default_factory=dict, init=False, repr=False, compare=False)

    def __post_init__(self) -> None:
        time = self.run["time"].to_numpy()
        check_requirements(self.scenario, method_of(self.run), float(time[-1]))
        if method_of(self.run).jitter_apart:
            try:
                rotors_of(self.run, self.scenario, self._judged_time)
            except ValueError as error:
                problem = Problem(str(error), ("requirements",))
                raise ScenarioError(self.scenario.name, [problem]) from None

    @property
    def _judged_time(self) -> tuple[float, float]:
        """From the first instant to the last that any requirement looks at [s]."""
        last = float(self.run["time"][-1])
        ends = [_stretch(each, last) for each in self.scenario.requirements]
        return min(start for start, _ in ends), max(end for _, end in ends)

    @cached_property
    def scenario(self) -> Scenario:
        """As it was run."""
        return scenario_of(self.run)

    @cached_property
    def _motions(self) -> dict[str, ImageMotion]:
        lines, judged = self.scenario.lines_of_sight, self._judged_time
        return {name: image_motion(self.run, name, judged) for name in lines}

    def motion(self, line_of_sight: str) -> ImageMotion:
        """Image motion of a line of sight [rad]."""
        return self._motions[choice("line_of_sight", line_of_sight, list(self._motions))]

    @cached_property
    def verdicts(self) -> tuple[Verdict, ...]:
        """In the order of the scenario."""
        return tuple(self._verdict(i) for i in range(len(self.scenario.requirements)))

    def judge(
        self, curves: bool = False, progress: Callable[[str, float], None] | None = None
    ) -> None:
        """Find all verdicts now, which otherwise are found when they are asked for.

        Args:
            curves: against exposure time, too.
            progress: called with what is being judged, and the share that is done.
        """
        requirements = self.scenario.requirements
        steps = len(requirements) * (1 + (CURVE if curves else 0))
        done = 0

        def step() -> None:
            nonlocal done
            if progress is not None:
                progress(what, done / steps)
            done += 1

        for i, requirement in enumerate(requirements):
            what = f"judging {_name(_metric(requirement))}"
            step()
            self._verdict(i)
            if curves:
                self.curve(i, step)
                done = (i + 1) * (1 + CURVE)  # some metrics have no curve
        if progress is not None:
            progress("judged", 1.0)

    def _verdict(self, i: int) -> Verdict:
        if i not in self._found:
            self._found[i] = self._judge(self.scenario.requirements[i])
        return self._found[i]

    def _judge(self, requirement: Any) -> Verdict:
        last = float(self.run["time"][-1])
        metric, stretch = _metric(requirement), _stretch(requirement, last)
        motion = self._judged(requirement)
        statistic = Statistic(
            requirement.confidence, requirement.interpretation, requirement.rotor_phases
        )
        parts = contributions(motion, metric, stretch)
        try:
            value = evaluate(motion, metric, stretch, statistic)
        except UnsoundStatisticError as error:
            raise UnsoundStatisticError(
                f"{_name(metric)} of {requirement.line_of_sight} is withheld: {error}"
            ) from None
        least = NOTHING * np.linalg.norm(list(parts.values()))
        return Verdict(
            name=_name(metric),
            line_of_sight=requirement.line_of_sight,
            metric=metric,
            statistic=statistic,
            meaning=_meaning(metric, statistic, motion),
            stretch=stretch,
            value=value,
            limit=requirement.at_most,
            contributions={name: rms for name, rms in parts.items() if rms > least},
            uncertainty=self._uncertainty(requirement.line_of_sight, metric, stretch),
        )

    def _uncertainty(
        self, line_of_sight: str, metric: Metric, stretch: tuple[float, float]
    ) -> float:
        """How much what the lines lack as they change may make of the metric [rad, or 1]."""
        if "line_of_sight_change_error" not in self.run:
            return 0.0
        missing = self.run["line_of_sight_change_error"].sel(line=line_of_sight).to_numpy()
        time = self.run["time"].to_numpy()
        first = max(int(np.searchsorted(time, stretch[0], side="right")) - 1, 0)
        last = int(np.searchsorted(time, stretch[1])) + 1
        return largest_change(metric, float(np.max(missing[first:last])))

    def _judged(self, requirement: Any) -> ImageMotion:
        motion = self.motion(requirement.line_of_sight)
        return motion if requirement.component is None else motion.component(requirement.component)

    @property
    def met(self) -> bool:
        """Whether all requirements are."""
        return all(verdict.met for verdict in self.verdicts)

    def curve(
        self, i: int, progress: Callable[[], None] | None = None
    ) -> tuple[np.ndarray, np.ndarray] | None:
        """Requirement i's metric [rad, or 1] against exposure time [s]; None if it has no window.

        From a thirtieth to thirty times its window, as far as the judged stretch goes, and not
        longer than tau of windows that must not overlap.
        """
        requirements = self.scenario.requirements
        if count("i", i, least=0) >= len(requirements):
            raise ValueError(f"i: expected a requirement's number below {len(requirements)}")
        verdict = self._verdict(i)
        metric = verdict.metric
        if not metric.window:
            return None
        if ("curve", i) in self._found:
            return self._found["curve", i]
        motion = self._judged(requirements[i])
        start, end = verdict.stretch
        longest = end - start - (metric.span - metric.window)
        if metric.name in ("PDE", "PRE"):
            longest = min(longest, metric.tau)
        windows = np.geomspace(metric.window / 30.0, min(30.0 * metric.window, longest), CURVE)
        values = []
        for T in windows:
            if progress is not None:
                progress()
            at = metric.with_window(T)
            values.append(evaluate(motion, at, verdict.stretch, verdict.statistic, CURVE_EFFORT))
        self._found["curve", i] = windows, np.array(values)
        return self._found["curve", i]

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
                        "uncertainty": verdict.shown(verdict.uncertainty),
                        "met": verdict.met,
                        "decided": verdict.decided,
                        "contributions_arcsec": {
                            name: ARCSEC * rms for name, rms in verdict.contributions.items()
                        },
                    }
                    for verdict in self.verdicts
                ],
            }
        )


def _metric(requirement: Any) -> Metric:
    fields = {
        name: getattr(requirement, name, 0.0)
        for name in ("window", "tau", "above", "spatial_frequency")
    }
    if hasattr(requirement, "middle_to_middle"):
        fields["tau"] = requirement.middle_to_middle
    return Metric(requirement.metric, **fields)


def _stretch(requirement: Any, last: float) -> tuple[float, float]:
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
    if method.jitter_apart and scenario.cluster.gimbal_motor and _gimbals_move(scenario):
        problems.append(Problem(RIPPLE, ("requirements",)))
    highest = _highest_noise(scenario) if method.jitter_apart else 0.0
    for i, requirement in enumerate(scenario.requirements):
        metric = _metric(requirement)
        if metric.span * highest > MOST_PERIODS:
            text = (
                f"expected a window (and tau) of at most {MOST_PERIODS / highest:.4g} s, in which "
                f"broadband noise up to {highest:g} Hz can be integrated over; got "
                f"{metric.span:g} s. Use method 'direct'"
            )
            problems.append(Problem(text, ("requirements", i, "window")))
        try:
            check_stretch(0.0, last, metric, _stretch(requirement, last))
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
        for unit in scenario.cluster.placed()
        if unit.rotor and unit.rotor.disturbance
        for spectrum in unit.rotor.disturbance.broadband.given().values()
    ]
    return max(ends, default=0.0)


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
    noisy = motion.noise is not None
    phases = "rotor phases as given" if given else "any rotor phases"
    if statistic.confidence is None:
        mean = "mean" if metric.name == "MTF_loss" else "RMS"
        return f"{mean} over time, {phases}"
    level = f"{100.0 * statistic.confidence:.6g} %"
    match statistic.interpretation, given:
        case "temporal", False:
            return f"{level} of the time for the worst rotor phases (temporal)"
        case "ensemble", False:
            noise = " and noise" if noisy else ""
            return f"always, for {level} of all rotor phases{noise} (ensemble)"
        case "mixed", False:
            return f"{level} of all times and rotor phases (mixed)"
        case "ensemble", True if noisy:
            return f"always, for {level} of all noise, {phases} (ensemble)"
        case "ensemble", True:
            return f"always, {phases} (ensemble of one member)"
        case _:
            return f"{level} of the time, {phases} ({statistic.interpretation})"


def image_motion(
    run: xr.Dataset, name: str, stretch: tuple[float, float] | None = None
) -> ImageMotion:
    """Image motion of a line of sight of the run's scenario [rad].

    The signal is the error against the commanded attitude, the whole of it of a direct run and its
    slow part of a harmonic one, whose lines and noise come beside it.

    Args:
        stretch: [s] over which rotors' speeds have to be steady; the whole run by default.

    Raises:
        ValueError: the scenario has no such line of sight, or the run has ripple of gimbal motors
            or rotors whose speed changes: lines of changing frequency.
    """
    scenario = scenario_of(run)
    if name not in scenario.lines_of_sight:
        known = ", ".join(scenario.lines_of_sight) or "none"
        raise ValueError(f"line of sight: expected one of {known}; got {name!r}")
    line = scenario.lines_of_sight[name]
    time = run["time"].to_numpy()
    signal = SampledSignal(time, _errors(run, scenario) @ (line.image() @ line.matrix()).T)
    if not method_of(run).jitter_apart:
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
    if np.any(run.get("line_of_sight_ripple_amplitude", 0.0)):
        raise ValueError(RIPPLE)
    speed, phase = rotors_of(run, scenario, stretch)
    lines = Lines(
        amplitude=image.reshape(len(time), -1, image.shape[-1]),
        frequency=np.outer(speed, orders).ravel(),
        phase=np.outer(phase, orders).ravel(),
        rotor=np.repeat(np.arange(len(speed)), len(orders)),
        order=np.tile(orders, len(speed)),
    )
    return ImageMotion(signal, lines, _noise(run, name, line.image()))


def rotors_of(
    run: xr.Dataset, scenario: Scenario, stretch: tuple[float, float] | None
) -> tuple[np.ndarray, np.ndarray]:
    """Speeds [rad/s] of the rotors and their angles at t = 0 [rad], as of steady ones.

    Raises:
        ValueError: a speed that changes within the stretch.
    """
    units = scenario.cluster.placed()
    if "rotor_speed" not in run:
        speed = np.array([unit.rotor.speed if unit.rotor else 0.0 for unit in units])
        return speed, np.array(scenario.cluster.phases())
    time = run["time"].to_numpy()
    start, end = stretch or (time[0], time[-1])
    here = (time >= start - 1e-9) & (time <= end + 1e-9)
    speeds, angles = (run[f"rotor_{part}"].to_numpy()[here] for part in ("speed", "angle"))
    change = float(np.max(np.ptp(speeds, axis=0)) / max(np.max(np.abs(speeds)), 1e-300))
    if change > STEADY:
        raise ValueError(
            f"the rotors' speeds change by up to {100 * change:.3g} % from {start:g} s to {end:g} "
            f"s, and the frequencies of their lines with them: a harmonic run judges stretches in "
            f"which they change by {100 * STEADY:g} % at most. Use method 'direct', or another "
            "stretch (start, end)"
        )
    speed = speeds.mean(axis=0)
    return speed, np.mean(angles - np.outer(time[here], speed), axis=0)


def _noise(run: xr.Dataset, name: str, image: np.ndarray) -> Noise | None:
    """Of a line of sight's image, by rotor; None where no rotor has a broadband disturbance."""
    if "line_of_sight_psd" not in run:
        return None
    psd, cross = (
        run[f"line_of_sight_{kind}"]
        .sel(line=name)
        .transpose("look", "frequency", "cmg", ...)
        .to_numpy()
        for kind in ("psd", "cospectrum")
    )
    density = psd[..., None] * np.eye(3)
    for k, pair in enumerate(run["pair"].to_numpy()):
        a, b = (AXES.index(axis) for axis in pair)
        density[..., a, b] = density[..., b, a] = cross[..., k]
    density = np.einsum("ia,lfjab,kb->lfjik", image, density, image)
    names = tuple(f"rotor {j}, broadband" for j in run["cmg"].to_numpy())
    return Noise(run["look"].to_numpy(), run["frequency"].to_numpy(), density, names)


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
