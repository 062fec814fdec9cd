"""Laws of struts, by their types."""

from __future__ import annotations

from typing import Annotated, Any, Literal

from quietbus.scenario.base import Damping, Part, PerLeg, Stiffness
from quietbus.scenario.kinds import Kinds


class StrutKind(Part):
    """What a scenario says of a law of struts: the base of kinds, users' own too."""

    def spring_and_damper(self) -> tuple[Any, Any] | None:
        """Stiffness [N/m] and damping [N s/m] that it comes down to, of all legs or of each.

        None of a law that does not.
        """
        return None

    def per_leg(self) -> tuple[str, ...]:
        """Keys whose lists have one value for each leg."""
        return ()


STRUTS = Kinds("strut", StrutKind)
AnyStrut = Annotated[Any, STRUTS]


@STRUTS.register
class SpringDamperStrut(StrutKind):
    """Linear spring and damper in parallel; one value for all legs, or one for each."""

    type: Literal["spring_damper"] = "spring_damper"
    stiffness: PerLeg[Stiffness]
    damping: PerLeg[Damping]

    def spring_and_damper(self) -> tuple[Any, Any]:
        return self.stiffness, self.damping

    def per_leg(self) -> tuple[str, ...]:
        return "stiffness", "damping"
