"""How a run is computed: the methods as objects, each with its tolerances. No JAX in here."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Any, ClassVar

from quietbus.arguments import positive
from quietbus.scenario import Scenario, ScenarioError
from quietbus.scenario.schema import Tolerances
from quietbus.words import shown


@dataclass(frozen=True)
class Method:
    """What every method has: tolerances of its integrator, of one step and in SI units."""

    relative_tolerance: float | None = None
    absolute_tolerance: float | None = None

    word: ClassVar[str]  # by which functions, files and the command line know it
    own_tolerances: ClassVar[Tolerances]  # where neither it nor the scenario says others
    jitter_apart: ClassVar[bool]  # runs have slow motion, and each line of the jitter beside it
    usual_rate: ClassVar[float | None]  # [Hz] of the output; None: the scenario's

    def __post_init__(self) -> None:
        for name, value in self._given().items():
            positive(f"{name}_tolerance", value)
        try:
            Tolerances(**self._given())
        except ScenarioError as error:
            wrong = error.problems[0]
            raise ValueError(f"{wrong.path[-1]}_tolerance: {wrong.message}") from None

    def tolerances(self, scenario: Scenario) -> Tolerances:
        """With which the method integrates a scenario.

        Each is the method's if it was given one. Otherwise it is of the scenario's
        ``simulation.tolerances``; and where these are the defaults, ``own_tolerances``.
        """
        said = scenario.simulation.tolerances
        chosen = self.own_tolerances if said == Tolerances() else said
        return Tolerances(**{**chosen.model_dump(), **self._given()})

    def output_rate(self, asked: Any) -> Any:
        """[Hz] as the caller asks for it, or as is usual; None: the scenario's."""
        return self.usual_rate if asked is None else asked

    def _given(self) -> dict[str, float]:
        both = {"relative": self.relative_tolerance, "absolute": self.absolute_tolerance}
        return {name: value for name, value in both.items() if value is not None}


class Direct(Method):
    """The nonlinear equations in time, every rotor turn resolved: ``"direct"``.

    Args:
        relative_tolerance: of one step; instead of the scenario's, which is 1e-8 by default.
        absolute_tolerance: of one step, SI units; instead of the scenario's, by default 1e-10.
    """

    word = "direct"
    own_tolerances = Tolerances()
    jitter_apart = False
    usual_rate = None


class Harmonic(Method):
    """The slow motion in time, and at each instant the steady jitter about it: ``"harmonic"``.

    Tolerances are of the slow motion; the jitter is solved for, and has none.

    Args:
        relative_tolerance: of one step; instead of the scenario's where that says other than the
            defaults, and of 1e-7 where it does not.
        absolute_tolerance: of one step, SI units; likewise, and 1e-9.
    """

    word = "harmonic"
    own_tolerances = Tolerances(relative=1e-7, absolute=1e-9)
    jitter_apart = True
    usual_rate = 10.0


METHODS: dict[str, type[Method]] = {kind.word: kind for kind in (Direct, Harmonic)}


def as_method(value: Any) -> Method:
    """The method that a caller means by an object or by a word.

    Raises:
        ValueError: neither.
    """
    if isinstance(value, Method):
        return value
    if not isinstance(value, str) or value not in METHODS:
        words = ", ".join(repr(word) for word in METHODS)
        objects = " or ".join(f"{kind.__name__}(...)" for kind in METHODS.values())
        raise ValueError(f"method: expected one of {words}, {objects}, got {shown(value)}")
    return METHODS[value]()
