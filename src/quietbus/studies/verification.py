"""Pointing requirements of a scenario against what a run of it shows (``quietbus verify``)."""

from collections.abc import Callable
from dataclasses import dataclass, field
from functools import cached_property
from importlib.metadata import version
from typing import Any

import numpy as np
import xarray as xr

from quietbus.analysis.pointing.chi_square import UnsoundStatisticError
from quietbus.analysis.pointing.metrics import contributions, evaluate
from quietbus.analysis.pointing.motion import ImageMotion
from quietbus.analysis.pointing.statistic import Statistic
from quietbus.analysis.pointing.windows import Metric, largest_change
from quietbus.arguments import choice, count
from quietbus.plain import ARCSEC, json_ready
from quietbus.results import method_of, scenario_of
from quietbus.scenario import Problem, Scenario, ScenarioError
from quietbus.studies.image_motion import image_motion, rotors_of
from quietbus.studies.requirements import check_requirements, metric_of, stretch_of
from quietbus.studies.verdict import Verdict, meaning, metric_name

CURVE = 17  # exposure times
CURVE_EFFORT = 0.1
NOTHING = 1e-9  # of all: lines that are left out of the contributions


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
                rotors_of(self.run, self._judged_time)
            except ValueError as error:
                problem = Problem(str(error), ("requirements",))
                raise ScenarioError(self.scenario.name, [problem]) from None

    @property
    def _judged_time(self) -> tuple[float, float]:
        """From the first instant to the last that any requirement looks at [s]."""
        last = float(self.run["time"][-1])
        ends = [stretch_of(each, last) for each in self.scenario.requirements]
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
            what = f"judging {metric_name(metric_of(requirement))}"
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
        metric, stretch = metric_of(requirement), stretch_of(requirement, last)
        motion = self._judged(requirement)
        statistic = Statistic(
            requirement.confidence, requirement.interpretation, requirement.rotor_phases
        )
        parts = contributions(motion, metric, stretch)
        try:
            value = evaluate(motion, metric, stretch, statistic)
        except UnsoundStatisticError as error:
            raise UnsoundStatisticError(
                f"{metric_name(metric)} of {requirement.line_of_sight} is withheld: {error}"
            ) from None
        least = NOTHING * np.linalg.norm(list(parts.values()))
        return Verdict(
            name=metric_name(metric),
            line_of_sight=requirement.line_of_sight,
            metric=metric,
            statistic=statistic,
            meaning=meaning(metric, statistic, motion),
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
