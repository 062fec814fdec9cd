"""The scenario's run-up: rotors whose speed follows a prescribed profile."""

from __future__ import annotations

from typing import Literal

from quietbus.scenario.base import AngularVelocity, Duration, Part, PerLeg, StartTime


class RunUp(Part):
    """A change of all rotors' speeds; one value for all units or a list with one for each."""

    initial_speed: PerLeg[AngularVelocity] = 0.0
    final_speed: PerLeg[AngularVelocity] | None = None  # None: each rotor's `speed`
    start: StartTime = 0.0
    duration: Duration
    shape: Literal["smooth", "linear"] = "smooth"

    def speeds(self, nominal: tuple[float, ...]) -> tuple[tuple[float, ...], tuple[float, ...]]:
        """Initial and final speed of each unit [rad/s].

        Args:
            nominal: of each rotor [rad/s].
        """

        def each(value: float | tuple[float, ...]) -> tuple[float, ...]:
            return value if isinstance(value, tuple) else (value,) * len(nominal)

        final = nominal if self.final_speed is None else each(self.final_speed)
        return each(self.initial_speed), final
