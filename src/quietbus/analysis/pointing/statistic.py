"""What number of a pointing metric is wanted.

What varies is the instant (or window) within the stretch that is judged, and the member of the
ensemble: the rotors' phases, which nobody controls, and the noise. ECSS-E-ST-60-10C has three
interpretations of "within the limit with probability p":

- ensemble: for a share p of the members, at all times;
- temporal: for the worst member, a share p of the time;
- mixed: a share p of all members and times together.
"""

from dataclasses import dataclass
from typing import Literal

Interpretation = Literal["ensemble", "temporal", "mixed"]
Phases = Literal["random", "given"]
INTERPRETATIONS = ("ensemble", "temporal", "mixed")


@dataclass(frozen=True)
class Statistic:
    """What number of a metric is wanted.

    Raises:
        ValueError: a confidence level outside (0, 1), or an unknown word.
    """

    confidence: float | None = None  # None: root mean square (mean, of MTF_loss) over all
    interpretation: Interpretation = "temporal"
    phases: Phases = "random"  # of the rotors; given: those of the run are the only member

    def __post_init__(self) -> None:
        if self.confidence is not None and not 0.0 < self.confidence < 1.0:
            raise ValueError(f"expected a confidence level between 0 and 1, got {self.confidence}")
        if self.interpretation not in INTERPRETATIONS:
            known = ", ".join(INTERPRETATIONS)
            raise ValueError(f"interpretation: expected one of {known}; got {self.interpretation}")
        if self.phases not in ("random", "given"):
            raise ValueError(f"phases: expected random or given, got {self.phases}")
