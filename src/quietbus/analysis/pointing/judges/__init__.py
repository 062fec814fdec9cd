"""Who judges a metric of image motion: one judge for each family of metrics."""

from quietbus.analysis.pointing.judges.band import BandJudge
from quietbus.analysis.pointing.judges.base import Judge
from quietbus.analysis.pointing.judges.jitter import NoisyJitterJudge, QuietJitterJudge
from quietbus.analysis.pointing.judges.linear import LinearJudge
from quietbus.analysis.pointing.judges.loss import NoisyLossJudge, QuietLossJudge
from quietbus.analysis.pointing.motion import ImageMotion
from quietbus.analysis.pointing.windows import LINEAR, Metric

FAMILIES: dict[str, tuple[type[Judge], type[Judge]]] = {  # without noise, with it
    **dict.fromkeys(LINEAR, (LinearJudge, LinearJudge)),
    "rms": (BandJudge, BandJudge),
    "jitter": (QuietJitterJudge, NoisyJitterJudge),
    "MTF_loss": (QuietLossJudge, NoisyLossJudge),
}


def judge_of(
    motion: ImageMotion, metric: Metric, stretch: tuple[float, float], effort: float = 1.0
) -> Judge:
    """The judge of a metric.

    Args:
        stretch: from, to [s]; windows lie within.
        effort: share of the usual windows and members that are looked at.
    """
    return FAMILIES[metric.name][motion.noisy](motion, metric, stretch, effort)
