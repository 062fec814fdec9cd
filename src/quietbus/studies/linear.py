"""Everything that linear analysis says of a scenario (``quietbus analyze``)."""

from dataclasses import dataclass
from functools import cached_property
from importlib.metadata import version
from typing import Any

import equinox as eqx
import numpy as np

from quietbus.analysis.control.channels import Channels, channels
from quietbus.analysis.control.controlled import ControlledSatellite, controlled
from quietbus.analysis.control.coupled import CoupledAnalysis, analyze_coupled, stable_gain_range
from quietbus.analysis.control.designs import DesignRule, corner_rule
from quietbus.analysis.control.hexapod import (
    HexapodIsolator,
    SingleAxisPlatform,
    StrutMemory,
    hexapod_isolator,
)
from quietbus.analysis.control.loop import Loop, attitude_loop
from quietbus.analysis.control.margins import LoopAnalysis, analyze_loop
from quietbus.analysis.control.modes import Mode, fixed_base_modes, free_modes
from quietbus.analysis.control.pid import PID
from quietbus.analysis.control.stability import nearest_range
from quietbus.analysis.control.transmissibility import Places, Transmissibility, transmissibility
from quietbus.arguments import array, choice
from quietbus.build import build_satellite, energy_notes
from quietbus.dynamics.linearize import (
    AXES,
    Actuation,
    LinearModel,
    OperatingPoint,
    linearize,
    platform_inertia,
)
from quietbus.model.body import Mount
from quietbus.model.satellite import Satellite
from quietbus.model.variants import (
    with_base_fixed,
    with_mount,
    without_friction,
    without_leg_mass,
    without_rotation,
)
from quietbus.plain import json_ready
from quietbus.scenario import Problem, Scenario, ScenarioError
from quietbus.spatial.rotation import quaternion_to_matrix


@dataclass(frozen=True)
class Study:
    """Linear analysis of one scenario at rest, at given gimbal angles; parts made when asked for.

    ``loops``, ``coupled`` and what follows from them are None without attitude control. Axes are
    those of the bus.
    """

    scenario: Scenario
    gimbal_angle: np.ndarray  # (cmg,) [rad]

    @cached_property
    def point(self) -> OperatingPoint:
        """At rest."""
        return OperatingPoint(np.zeros(3), self.gimbal_angle)

    @cached_property
    def satellite(self) -> Satellite:
        """Isolated, whatever the scenario's mount: the analysis is of the platform."""
        return build_satellite(self.scenario, "isolated")

    @property
    def _platform(self) -> Mount:
        """The platform that is analysed."""
        return self.satellite.mounts[0]

    @cached_property
    def pid(self) -> PID | None:
        """The scenario's controller; None without one, or if all its gains are zero."""
        control = self.scenario.control
        pid = control and PID(control.pid.kp, control.pid.ki, control.pid.kd)
        return pid if pid and pid.gain else None

    @cached_property
    def notes(self) -> list[str]:
        """What the user has to know of how the scenario was analysed."""
        notes = []
        if self.scenario.mount == "rigid":
            notes.append("The scenario's mount is rigid; what is analysed is the platform's.")
        if self.pid is None:
            which = "has no control" if self.scenario.control is None else "has gains of zero only"
            notes.append(f"The scenario {which}: no loop to analyse, those parts are empty.")
        elif not self.satellite.control.steering.acts:
            notes.append(
                "The scenario lets no unit act (steering: none), so that a run feels no control; "
                "the loop is analysed as if the plate received the torque that is asked for."
            )
        notes += [f"{note}." for note in energy_notes(self.scenario, self.satellite)]
        if len(self.scenario.sites) > 1:
            others = ", ".join(site.name for site in self.scenario.sites[1:])
            notes.append(
                f"Channels, the loops per axis and the rules are of {self._platform.body} alone, "
                f"as if there were no {others}. The coupled loop, the modes and the "
                "transmissibility have all bodies."
            )
        if self.channels.largest_coupling > 0.0:
            notes.append(self.channels.verdict)
        return notes

    def linear(self, actuator: Actuation = "servo") -> LinearModel:
        """The free satellite, linearised."""
        choice("actuator", actuator, ("servo", "ideal"))
        return linearize(self.satellite, self.point, actuator)

    @property
    def _tangent(self) -> list[np.ndarray]:
        """The platform's struts for small motion (a ``StrutTangent``).

        Raises:
            ScenarioError: one is negative, as a law of a user's own may have it.
        """
        site, legs = self.scenario.sites[0], self.satellite.hexapods[0]
        tangent = [np.asarray(each) for each in legs.tangent]
        for value, what in zip(tangent[:2], ("stiffness", "damping"), strict=True):
            if np.any(value < 0.0):
                said = f"expected a {what} of 0 or more at rest, as an analysis needs it, got "
                said = f"{type(legs.strut).__name__}.tension: {said}{value.min():.4g}"
                raise ScenarioError(self.scenario.name, [Problem(said, site.strut_at)])
        return tangent

    @cached_property
    def isolator(self) -> HexapodIsolator:
        """The platform on massless legs over a fixed base, about the base plate's centre."""
        isolator, (legs, *_) = self.scenario.sites[0].isolator, self.satellite.hexapods
        name = self._platform.body
        mass, center, inertia = platform_inertia(self.satellite, self.gimbal_angle, name)
        stiffness, damping, *memory = self._tangent
        base = np.asarray(isolator.offset)
        R_BP = np.asarray(quaternion_to_matrix(self._platform.q_BX))
        plate = np.asarray(self._platform.p_BX_B) - base
        return hexapod_isolator(  # in bus axes
            upper_joints=plate + np.asarray(legs.geometry.p_PU_P) @ R_BP.T,
            lower_joints=np.asarray(legs.geometry.p_BA_B) - base,
            separation=0.0,
            mass=mass,
            inertia=R_BP @ inertia @ R_BP.T,
            center_of_mass=plate + R_BP @ center,
            stiffness=stiffness,
            damping=damping,
            memory=StrutMemory(*memory),
        )

    @cached_property
    def channels(self) -> Channels:
        """Torque channels of the platform on a fixed base, massless legs (eq. 31-33)."""
        return channels(self.isolator)

    @cached_property
    def loops(self) -> dict[str, Loop] | None:
        """Open loops per axis as in the paper: PID, channel, 1/(I s^2) with the bus's inertia."""
        if self.pid is None:
            return None
        inertia = np.diag(np.asarray(self.scenario.bus.inertia))
        return {
            axis: attitude_loop(channel.numerator, channel.denominator, inertia[i], self.pid)
            for i, (axis, channel) in enumerate(zip(AXES, self.channels, strict=True))
        }

    @cached_property
    def loop_analyses(self) -> dict[str, LoopAnalysis] | None:
        """Ranges and margins per axis."""
        if self.loops is None:
            return None
        return {axis: analyze_loop(loop) for axis, loop in self.loops.items()}

    @cached_property
    def rules(self) -> dict[str, DesignRule] | None:
        """Corner over bandwidth per axis."""
        loops = self.loop_analyses
        if loops is None:
            return None
        return {
            axis: corner_rule(channel.peak_frequency_hz, loops[axis].bandwidth_hz)
            for axis, channel in zip(AXES, self.channels, strict=True)
        }

    @cached_property
    def controlled(self) -> ControlledSatellite | None:
        """The loop around the whole satellite, with gimbal servos if the gimbals are steered."""
        return controlled(self.linear(self._actuator), self.pid) if self.pid else None

    @property
    def _ideal(self) -> str:
        """Units that do at once what they are asked for."""
        return "ideal wheels" if not self.satellite.steered else "ideal gimbals"

    @property
    def _actuator(self) -> Actuation:
        return "ideal" if not self.satellite.control.steering.acts else "servo"

    @cached_property
    def coupled(self) -> CoupledAnalysis | None:
        """Ranges and margins of all axes together."""
        return analyze_coupled(self.controlled) if self.controlled else None

    @cached_property
    def truth(self) -> list[dict[str, Any]] | None:
        """What the per-axis analysis says, and what is so: one simplification lifted at a time."""
        if self.pid is None or self.loop_analyses is None or self.coupled is None:
            return None
        rows: list[dict[str, Any]] = [
            {
                "case": f"per axis, {axis}: base fixed, massless legs, {self._ideal}",
                "stable_gain_range": analysis.stable_gain_range,
                "gain_margins_db": analysis.gain_margins_db,
            }
            for axis, analysis in self.loop_analyses.items()
        ]
        still = without_rotation(self.satellite)
        light = without_leg_mass(still)
        bare = without_friction(light)
        steps = {
            "free bus, all axes, platform at the height of its mass centre": at_height(bare, 0.0),
            "the same, platform where it is": bare,
            "with joint friction": light,
            "with leg mass": still,
        }
        if self.satellite.control.steering.acts:
            steps["with rotor momentum"] = self.satellite
        results = {
            case: analyze_coupled(controlled(linearize(satellite, self.point, "ideal"), self.pid))
            for case, satellite in steps.items()
        }
        by = "the wheels' motion" if not self.satellite.steered else "gimbal servo"
        last = (
            "with rotor momentum" if not self.satellite.control.steering.acts else f"with {by}: all"
        )
        results[last] = self.coupled
        rows += [
            {
                "case": case,
                "stable_gain_range": result.stable_gain_range,
                "gain_margins_db": result.gain_margins_db,
                "disk_margin": result.disk_margin,
            }
            for case, result in results.items()
        ]
        return rows

    @cached_property
    def modes(self) -> dict[str, list[Mode]]:
        """Modes with the base fixed and of the free satellite, gimbals held."""
        fixed = linearize(with_base_fixed(self.satellite), self.point, "ideal")
        return {"fixed_base": fixed_base_modes(fixed), "free": free_modes(self.linear("ideal"))}

    @cached_property
    def vertical_isolator(self) -> SingleAxisPlatform:
        """The platform as one mass on its struts, along the base plate's z axis."""
        z = np.asarray(quaternion_to_matrix(self._platform.q_BX))[:, 2]
        return SingleAxisPlatform(self.isolator, self.isolator.legs_P[:, :3] @ z)

    @property
    def rotor_frequencies_hz(self) -> np.ndarray:
        """Frequencies [Hz] at which rotors turn, ascending; 100 Hz if none does."""
        turns = np.abs(np.asarray(self.satellite.rotor_speed)) / (2.0 * np.pi)
        distinct = np.unique(np.round(turns[turns > 0.0], 9))
        return distinct if distinct.size else np.array([100.0])

    def transmissibility(self, frequency_hz: np.ndarray) -> Transmissibility:
        """Transmissibility of the platform on the free satellite at frequencies [Hz]."""
        frequency_hz = array("frequency_hz", frequency_hz, "frequencies in Hz above 0").reshape(-1)
        if not np.all(frequency_hz > 0.0):
            raise ValueError("frequency_hz: expected frequencies above 0 Hz")
        rigid = with_mount(self.satellite, welded=True)
        places = Places(
            mass=float(self.satellite.bus.mass_X),
            inertia=np.asarray(self.satellite.bus.I_XXcm_X),
            base=np.asarray(self.scenario.sites[0].isolator.offset),
            R_BP=np.asarray(quaternion_to_matrix(self._platform.q_BX)),
            center=platform_inertia(self.satellite, self.gimbal_angle, self._platform.body)[1],
        )
        return transmissibility(
            self.linear("ideal"), linearize(rigid, self.point, "ideal"), places, frequency_hz
        )

    def limits_by_height(self, heights: np.ndarray) -> np.ndarray:
        """Ends of the coupled loop's stable range (height, low and high), platform moved along z.

        NaN where no gain is stable; infinite for no upper end.

        Args:
            heights: (n,) of the plate's origin over the bus mass centre [m].
        """
        if self.pid is None:
            raise ValueError("limits_by_height: the scenario has no control")
        heights = array("heights", heights, "heights in m").reshape(-1)
        ends = []
        for height in heights:
            model = linearize(at_height(self.satellite, height), self.point, self._actuator)
            ranges = stable_gain_range(controlled(model, self.pid))
            ends.append(nearest_range(ranges, self.pid.gain))
        return np.array(ends)

    def to_dict(self) -> dict[str, Any]:
        """For JSON, with the keys of the interface; see docs/analysis.md."""
        loops, rules = self.loop_analyses, self.rules
        return json_ready(
            {
                "scenario": self.scenario.name,
                "version": version("quietbus"),
                "notes": self.notes,
                "gimbal_angle": self.gimbal_angle.tolist(),
                "channels": self.channels.to_dict(),
                "channel_coupling": {
                    "peak_gain": self.channels.coupling,
                    "verdict": self.channels.verdict,
                },
                "loop": loops and {axis: loop.to_dict() for axis, loop in loops.items()},
                "rules": rules and {axis: rule.to_dict() for axis, rule in rules.items()},
                "coupled": self.coupled and self.coupled.to_dict(),
                "truth": self.truth,
                "modes": {
                    base: [mode.to_dict() for mode in modes] for base, modes in self.modes.items()
                },
            }
        )


def at_height(satellite: Satellite, height: float) -> Satellite:
    """The satellite with its platform moved along bus z, so that its plate is at ``height`` [m]."""
    shift = np.array([0.0, 0.0, height - float(satellite.mounts[0].p_BX_B[2])])
    places = lambda s: (s.mounts[0].p_BX_B, s.hexapods[0].geometry.p_BA_B)  # noqa: E731
    return eqx.tree_at(places, satellite, tuple(value + shift for value in places(satellite)))
