"""One requirement judged, and what its number means in words."""

from dataclasses import dataclass

from quietbus.analysis.pointing.motion import ImageMotion
from quietbus.analysis.pointing.statistic import Statistic
from quietbus.analysis.pointing.windows import Metric
from quietbus.plain import ARCSEC


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


def metric_name(metric: Metric) -> str:
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


def meaning(metric: Metric, statistic: Statistic, motion: ImageMotion) -> str:
    """What the value is, in words."""
    given = not motion.apart or statistic.phases == "given"
    phases = "rotor phases as given" if given else "any rotor phases"
    if statistic.confidence is None:
        mean = "mean" if metric.name == "MTF_loss" else "RMS"
        return f"{mean} over time, {phases}"
    level = f"{100.0 * statistic.confidence:.6g} %"
    match statistic.interpretation, given:
        case "temporal", False:
            return f"{level} of the time for the worst rotor phases (temporal)"
        case "ensemble", False:
            noise = " and noise" if motion.noisy else ""
            return f"always, for {level} of all rotor phases{noise} (ensemble)"
        case "mixed", False:
            return f"{level} of all times and rotor phases (mixed)"
        case "ensemble", True if motion.noisy:
            return f"always, for {level} of all noise, {phases} (ensemble)"
        case "ensemble", True:
            return f"always, {phases} (ensemble of one member)"
        case _:
            return f"{level} of the time, {phases} ({statistic.interpretation})"
