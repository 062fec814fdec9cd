"""The scenario's lines of sight, and what is required of their pointing."""

from __future__ import annotations

import math
from collections import Counter
from collections.abc import Mapping
from typing import Annotated, Any, Literal, Self

import numpy as np
from pydantic import AfterValidator, BeforeValidator, Discriminator, Tag, model_validator

from quietbus.scenario.base import (
    Duration,
    Frequency,
    FrozenDict,
    Name,
    Number,
    Part,
    StartTime,
    Text,
    UnitVector,
    bad_name,
    listing,
    name_defect,
)
from quietbus.scenario.errors import Findings
from quietbus.scenario.units import Quantity, expected, whole_number

MOST_SIGMAS = 8.0  # beyond it the probability is 1 to the last digit
COLUMNS = 12  # turn and displacement of the bus, then those of the plate relative to the bus


Row = Annotated[tuple[Number, ...], listing(COLUMNS, "numbers")]


class LineOfSight(Part):
    """What of the satellite's motion moves an image: exactly one of the two.

    The sensitivity's rows are one or two image components [rad], its columns the turn of the bus
    from its target [rad], the displacement of the bus [m], and turn [rad] and displacement [m] of
    the upper plate from its place in the bus; all along bus axes.
    """

    on: Name | None = None  # the body that it is on; None: the payload, or else the bus
    direction: UnitVector | None = None  # fixed in that body, its frame
    sensitivity: Annotated[tuple[Row, ...], listing(None, f"rows of {COLUMNS} numbers")] | None = (
        None
    )

    @model_validator(mode="after")
    def _check(self) -> Self:
        findings = Findings()
        given = [key for key in ("direction", "sensitivity") if getattr(self, key) is not None]
        if len(given) != 1:
            got = " and ".join(given) or "neither"
            findings.add((), f"expected one of direction and sensitivity, got {got}")
        elif self.sensitivity is not None:
            if len(self.sensitivity) > 2:
                findings.add(
                    "sensitivity",
                    "expected one or two rows, an image has no more directions; got "
                    f"{len(self.sensitivity)}",
                )
            elif not np.any(self.sensitivity):
                findings.add("sensitivity", "expected a matrix that is not zero")
        findings.raise_any()
        return self

    @property
    def components(self) -> int:
        """Of the image motion: two across a direction."""
        return 2 if self.sensitivity is None else len(self.sensitivity)

    def matrix(self) -> np.ndarray:
        """(3, 12) what those motions do: theta x direction, or the rows filled up with zeros."""
        if self.direction is not None:
            by_turn = np.cross(np.eye(3), self.direction).T
            return np.hstack([by_turn, np.zeros((3, 9))])
        return np.pad(np.array(self.sensitivity), ((0, 3 - self.components), (0, 0)))

    def image(self) -> np.ndarray:
        """(c, 3) from the three above to image components: two axes across a direction."""
        if self.direction is not None:
            return np.linalg.svd(np.array([self.direction]))[2][1:]
        return np.eye(3)[: self.components]


def _names(value: Any) -> Any:
    if not isinstance(value, Mapping):
        raise expected("a mapping from names to lines of sight", value)
    findings = Findings()
    for key in value:
        defect = name_defect(key)
        if defect is not None:
            findings.add(str(key), bad_name(key, defect).message())
    findings.raise_any()
    return dict(value)


LinesOfSight = Annotated[
    dict[str, LineOfSight], BeforeValidator(_names), AfterValidator(FrozenDict)
]


def _below_one(value: float) -> float:
    if value >= 1.0:
        raise expected("a confidence level between 0 and 1", value)
    return value


def _of_sigmas(value: Any) -> Any:
    """``3 sigma`` as the probability that a normal variable is within three deviations."""
    text = value.strip() if isinstance(value, str) else ""
    word = next((word for word in ("sigma", "σ") if text.lower().endswith(word)), None)
    if word is None:
        return value
    try:
        count = float(text[: -len(word)].rstrip(" -*"))
    except ValueError:
        count = math.nan
    if not 0.0 < count <= MOST_SIGMAS:
        raise expected(f"a number of sigmas above 0 and up to {MOST_SIGMAS:g}", value)
    return math.erf(count / math.sqrt(2.0))


Confidence = Annotated[
    float,
    Quantity("a confidence level between 0 and 1", "", above=0.0),
    AfterValidator(_below_one),
    BeforeValidator(_of_sigmas),
]
AngleLimit = Annotated[float, Quantity("an angle", "rad", above=0.0)]
LossLimit = Annotated[float, Quantity("a plain number", "", above=0.0)]
SpatialFrequency = Annotated[float, Quantity("a spatial frequency", "1/rad", above=0.0)]


def _component(value: Any) -> Any:
    if isinstance(value, bool) or value not in (0, 1):
        raise expected("0 or 1, an image component", value)
    return value


class _Requirement(Part):
    """A metric of a line of sight that is to be at most so large."""

    line_of_sight: Text
    component: Annotated[Literal[0, 1] | None, BeforeValidator(_component)] = None
    confidence: Confidence | None = None
    interpretation: Literal["ensemble", "temporal", "mixed"] = "temporal"
    rotor_phases: Literal["random", "given"] = "random"
    start: StartTime | None = None  # of the stretch judged
    end: Duration | None = None

    @model_validator(mode="after")
    def _check_stretch(self) -> Self:
        findings = Findings()
        if self.start is not None and self.end is not None and self.end <= self.start:
            findings.add("end", f"expected a time after start ({self.start:g} s), got {self.end:g}")
        findings.raise_any()
        return self


class LossRequirement(_Requirement):
    """Contrast that jitter and smear take at a spatial frequency."""

    metric: Literal["MTF_loss"]
    window: Duration
    spatial_frequency: SpatialFrequency
    at_most: LossLimit


class InstantRequirement(_Requirement):
    """The error at any instant."""

    metric: Literal["APE"]
    at_most: AngleLimit


class BandRequirement(_Requirement):
    """Root mean square of the motion from a frequency on."""

    metric: Literal["rms"]
    above: Frequency
    at_most: AngleLimit


class WindowRequirement(_Requirement):
    """What happens in a window, an exposure."""

    metric: Literal["MPE", "RPE", "displacement", "smear", "jitter"]
    window: Duration
    at_most: AngleLimit


class ChangeRequirement(_Requirement):
    """From one instant to another, tau later."""

    metric: Literal["stability"]
    tau: Duration
    at_most: AngleLimit


class WindowedChangeRequirement(_Requirement):
    """From the mean of one window to that of another, whose middle is tau later."""

    metric: Literal["windowed_stability"]
    window: Duration
    tau: Duration
    at_most: AngleLimit


class DriftRequirement(_Requirement):
    """From the mean of one window to that of another, which does not overlap it.

    Either tau, from middle to middle, or the separation, from end to beginning.
    """

    metric: Literal["PDE", "PRE"]
    window: Duration
    tau: Duration | None = None
    separation: StartTime | None = None
    at_most: AngleLimit

    @model_validator(mode="after")
    def _check_windows(self) -> Self:
        findings = Findings()
        given = [key for key in ("tau", "separation") if getattr(self, key) is not None]
        if len(given) != 1:
            got = " and ".join(given) or "neither"
            findings.add((), f"expected one of tau and separation, got {got}")
        elif self.tau is not None and self.tau < self.window * (1.0 - 1e-9):
            findings.add(
                "tau",
                f"expected the window ({self.window:g} s) or more, or the two windows overlap; got "
                f"{self.tau:g} s. windowed_stability may overlap",
            )
        findings.raise_any()
        return self

    @property
    def middle_to_middle(self) -> float:
        """[s] from one window to the next."""
        return self.window + (self.separation or 0.0) if self.tau is None else self.tau


_FORMS: dict[str, type[_Requirement]] = {
    name: form
    for form in (
        InstantRequirement,
        WindowRequirement,
        DriftRequirement,
        ChangeRequirement,
        WindowedChangeRequirement,
        BandRequirement,
        LossRequirement,
    )
    for name in form.model_fields["metric"].annotation.__args__  # type: ignore[union-attr]
}
KNOWLEDGE = ("AKE", "MKE", "RKE")
NO_KNOWLEDGE = (
    "an error of the attitude as known on board, which a scenario has no sensors for: the control "
    "knows the true attitude. Expected an error of pointing: APE, MPE, RPE"
)
NO_WINDOW = (
    "stability is the change from one instant to another, tau later; of the means of windows it is "
    "windowed_stability"
)
EXAMPLE = "RPE(camera, window = 5 ms, confidence = 0.997) <= 0.1 arcsec"
NO_REQUIREMENTS = f"""expected one or more, for example:

lines_of_sight:
  camera: {{direction: [0, 0, -1]}}
requirements:
  - {EXAMPLE}"""


def _read(value: Any) -> Any:
    """A mapping of a known metric; the short form ``METRIC(line, key = value) <= limit`` too."""
    if isinstance(value, Part):
        return value
    if isinstance(value, str):
        given = _short(value)
        if given is None:
            raise expected(f"a mapping with the key metric, or a text like {EXAMPLE!r}", value)
        twice = [key for key, times in Counter(key for key, _ in given).items() if times > 1]
        if twice:
            raise expected(f"each key once, not {', '.join(sorted(twice))} twice", value)
        value = dict(given)
    if not isinstance(value, dict):
        raise expected(f"a mapping with the key metric, or a text like {EXAMPLE!r}", value)
    findings = Findings()
    metric = value.get("metric")
    if metric in KNOWLEDGE:
        findings.add("metric", f"{metric}: {NO_KNOWLEDGE}")
    elif metric == "stability" and "window" in value:
        findings.add("window", NO_WINDOW)
    elif not isinstance(metric, str) or metric not in _FORMS:
        error = expected(f"one of {', '.join(sorted(_FORMS, key=str.lower))}", metric)
        findings.add("metric", error.message())
    findings.raise_any()
    return value


def _short(text: str) -> list[tuple[str, str | int]] | None:
    """Keys and values of ``METRIC(line, key = value) <= limit``; None if it has not this form."""
    call, _, limit = text.replace("≤", "<=").partition("<=")
    metric, bracket, inside = call.strip().partition("(")
    line, *options = inside.removesuffix(")").split(",")
    given: list[tuple[str, str | int]] = [
        ("metric", metric.strip()),
        ("line_of_sight", line.strip()),
        ("at_most", limit.strip()),
    ]
    for option in options:
        key, _, value = option.partition("=")
        given.append((key.strip(), _plain(value.strip())))
    whole = bracket and inside.endswith(")") and all(key and value != "" for key, value in given)
    return given if whole else None


def _plain(text: str) -> str | int:
    return int(text) if whole_number(text) else text


def _form(value: Any) -> str:
    name = value["metric"] if isinstance(value, dict) else value.metric
    return f"<{_FORMS[name].__name__}>"


Requirement = Annotated[
    Annotated[LossRequirement, Tag("<LossRequirement>")]
    | Annotated[InstantRequirement, Tag("<InstantRequirement>")]
    | Annotated[BandRequirement, Tag("<BandRequirement>")]
    | Annotated[WindowRequirement, Tag("<WindowRequirement>")]
    | Annotated[DriftRequirement, Tag("<DriftRequirement>")]
    | Annotated[ChangeRequirement, Tag("<ChangeRequirement>")]
    | Annotated[WindowedChangeRequirement, Tag("<WindowedChangeRequirement>")],
    Discriminator(_form),
    BeforeValidator(_read),
]
Requirements = Annotated[tuple[Requirement, ...], listing(None, "requirements", least=0)]


def unknown_lines(
    requirements: tuple[_Requirement, ...], lines: Mapping[str, LineOfSight]
) -> Findings:
    """Requirements on lines of sight, or on components, that there are not."""
    findings = Findings()
    for i, requirement in enumerate(requirements):
        line = lines.get(requirement.line_of_sight)
        where = ("requirements", i)
        if line is None:
            known = f"one of {', '.join(lines)}" if lines else "a name under lines_of_sight"
            error = expected(known, requirement.line_of_sight)
            findings.add((*where, "line_of_sight"), error.message())
        elif requirement.component is not None and requirement.component >= line.components:
            error = expected(f"0, the only image component of {requirement.line_of_sight}", 1)
            findings.add((*where, "component"), error.message())
    return findings
