"""Pointing metrics of image motion, with statistics at a stated confidence level.

The functions return the smallest limit that is met with the confidence that ``statistic`` defines
(docs/theory.md, section 16).
"""

import numpy as np

from quietbus.analysis.pointing.judges import judge_of
from quietbus.analysis.pointing.motion import ImageMotion
from quietbus.analysis.pointing.statistic import Statistic
from quietbus.analysis.pointing.windows import DRIFTS, Metric, weight


def evaluate(
    motion: ImageMotion,
    metric: Metric,
    stretch: tuple[float, float],
    wanted: Statistic,
    effort: float = 1.0,
) -> float:
    """A metric of image motion: [rad], or [-] of ``MTF_loss``.

    Of motion with two components it is that of the distance, of ``MTF_loss`` the worst direction.

    Args:
        stretch: from, to [s]; windows lie within.
        effort: share of the usual windows and members that are looked at.

    Raises:
        ValueError: a stretch outside the samples, or a window (and tau) longer than the stretch.
    """
    check_stretch(float(motion.signal.time[0]), float(motion.signal.time[-1]), metric, stretch)
    judge = judge_of(motion, metric, stretch, effort)
    if wanted.confidence is None:
        return judge.average(wanted.phases)
    alone = judge.alone(wanted.phases)
    match wanted.interpretation, alone:
        case "ensemble", _:
            return judge.ensemble(wanted.confidence, alone)
        case _, True:
            return judge.quantile(wanted.confidence, np.zeros((1, judge.rotors)))
        case "temporal", False:
            return judge.worst_member(wanted.confidence)
        case _:
            return judge.quantile(wanted.confidence, *judge.draws())


def contributions(
    motion: ImageMotion, metric: Metric, stretch: tuple[float, float]
) -> dict[str, float]:
    """Root mean square that slow motion, each line and noise alone have in a metric [rad].

    Of ``MTF_loss`` it is that of smear and jitter, the motion within the window. Independent
    phases: the squares add up to that of all.
    """
    check_stretch(float(motion.signal.time[0]), float(motion.signal.time[-1]), metric, stretch)
    judge = judge_of(motion, metric, stretch)
    lines, noise = judge.lines, judge.noise
    share = weight(metric, np.abs(lines.frequency) / (2.0 * np.pi))
    power = share * np.mean(np.sum(0.5 * np.abs(judge.base) ** 2, axis=2), axis=0)
    parts = {"slow motion" if motion.apart else "motion": judge.slow_mean_square}
    parts |= dict(zip(lines.names, power.tolist(), strict=True))
    parts |= dict(zip(noise.names, judge.noise_powers.tolist(), strict=True))
    return {name: float(np.sqrt(value)) for name, value in parts.items()}


def check_stretch(first: float, last: float, metric: Metric, stretch: tuple[float, float]) -> None:
    """Refuse a stretch outside a run from first to last [s], and a window longer than the stretch.

    Raises:
        ValueError: says which.
    """
    start, end = stretch
    slack = 1e-9 * max(1.0, last)
    if not (first - slack <= start < end <= last + slack):
        raise ValueError(
            f"expected a stretch within the run, {first:g} s to {last:g} s; got {start:g} s to "
            f"{end:g} s"
        )
    if metric.span > (end - start) * (1.0 + 1e-9):
        what = {"stability": "a tau"}.get(metric.name, "a window")
        what = "window and tau together" if metric.name in DRIFTS and metric.window else what
        raise ValueError(
            f"expected {what} of at most {end - start:g} s, the stretch judged ({start:g} s to "
            f"{end:g} s); got {metric.span:g} s"
        )
