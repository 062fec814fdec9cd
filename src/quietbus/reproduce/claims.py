"""Published numbers, and the one rule by which each is judged."""

from collections.abc import Mapping
from dataclasses import dataclass
from decimal import Decimal
from typing import Any, Literal

CLOSE = 0.01  # [-] relative difference below which a number counts as reproduced
FACTOR = 3.0  # [-] within which an order of magnitude is met
Origin = Literal["input", "derived", "simulated"]
ORIGINS: dict[Origin, str] = {
    "input": "given to the model, or assumed so that it comes out: agreement shows no more than "
    "that the file was read",
    "derived": "follows from the inputs by linear analysis or kinematics, or from the paper's own "
    "numbers",
    "simulated": "a flight of the nonlinear model",
}
RULES = {
    "within rounding": "our value, rounded to the digits that the paper prints, is the paper's",
    "reproduced": f"relative difference below {100 * CLOSE:g} %",
    "order of magnitude": f"within a factor of {FACTOR:g}, and the value depends on parameters "
    "that the paper does not state or is given by it as a rough one",
    "not reproduced": "none of these",
    "paper in error": "the reason is computed and stated in the row; comes before the other rules",
    "not computed": "the figure that the number belongs to failed or was not reached",
}


@dataclass(frozen=True)
class Claim:
    """One published number."""

    name: str  # of our value among the findings
    place: str  # in the paper
    what: str
    printed: str  # as the paper prints it; empty where ``given`` says what it gives
    unit: str
    why: str  # one sentence on the verdict; {names} are findings
    origin: Origin  # of our value
    repeats: str | None = (
        None  # claim of which this is the same number once more, by symmetry or rule
    )
    assumed: bool = False  # depends on what the paper does not state, or is a rough number
    number: float | None = None  # where `printed` is not a number itself
    rounding: float | None = None  # instead of half a unit of the last printed digit
    error: str | None = None  # finding that, if it is not zero, shows the paper to be in error
    given: str | None = None  # finding that is what the paper's equation, as printed, gives

    @property
    def published(self) -> float:
        """The published value in ``unit``; of an equation's row see ``given``."""
        return float(self.printed) if self.number is None else self.number

    @property
    def half_unit(self) -> float:
        """Largest difference [unit] that rounding explains."""
        if self.rounding is not None:
            return self.rounding
        if self.number is not None or self.given is not None:
            return 0.0
        exponent = Decimal(self.printed).as_tuple().exponent
        return 0.5 * 10.0 ** int(exponent)

    def judge(self, ours: float, published: float) -> str:
        """The verdict on our value; that of an error in the paper apart (see ``RULES``)."""
        difference = abs(ours - published)
        if difference <= self.half_unit * (1.0 + 1e-9):
            return "within rounding"
        if difference < CLOSE * abs(published):
            return "reproduced"
        ratio = ours / published if published else 0.0
        if self.assumed and 1.0 / FACTOR <= ratio <= FACTOR:
            return "order of magnitude"
        return "not reproduced"

    def row(self, findings: Mapping[str, float]) -> dict[str, Any]:
        """The row of the table, from what was computed."""
        row: dict[str, Any] = {
            "name": self.name,
            "place": self.place,
            "quantity": self.what,
            "origin": self.origin,
            "repeats": self.repeats,
            "unit": self.unit,
        }
        ours = findings.get(self.name)
        published = self.published if self.given is None else findings.get(self.given)
        if ours is None or published is None:
            return row | {
                "printed": self.printed,
                "published": published,
                "ours": None,
                "relative_difference": None,
                "verdict": "not computed",
                "why": RULES["not computed"],
            }
        shown = self.error is not None and findings[self.error] != 0.0
        return row | {
            "printed": self.printed or f"{published:.2g}",
            "published": published,
            "ours": ours,
            "relative_difference": (ours - published) / abs(published) if published else None,
            "verdict": "paper in error" if shown else self.judge(ours, published),
            "why": self.why.format(**findings),
        }
