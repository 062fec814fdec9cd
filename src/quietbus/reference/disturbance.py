"""Lines of rotors and of gimbal motors (docs/theory.md, section 15); noise is left out."""

import numpy as np
from scipy.spatial.transform import Rotation

from quietbus.reference.mechanism import Mechanism
from quietbus.reference.motion import Motion
from quietbus.reference.platforms import Block, Data, blocks
from quietbus.reference.units import random_angles, seed_of, unit_data

COMPONENTS = ("radial_force", "axial_force", "radial_torque", "axial_torque")


class RotorLines:
    """Forces and torques of the rotors' order tables, through the modes of their bearings."""

    def __init__(self, data: Data, mechanism: Mechanism) -> None:
        self._mechanism = mechanism
        units = [unit for block in blocks(data) for unit in unit_data(block.data)]
        tables = [unit["rotor"].get("disturbance") for unit in units]
        self._lines = [_lines(table, j) for j, table in enumerate(tables)]
        self._modes = [(table or {}).get("resonances", {}) for table in tables]
        self.any = any(self._lines)

    def wrenches(self, motion: Motion, R_NX: np.ndarray) -> np.ndarray:
        """Forces [N] and torques [N m] of all lines about each body's origin, inertial.

        Args:
            R_NX: (body, 3, 3) attitudes.

        Returns:
            (body, 2, 3)
        """
        units, total = self._mechanism.units, np.zeros((len(R_NX), 2, 3))
        for j, lines in enumerate(self._lines):
            speed, angle = motion.rotor_speed[j], motion.rotor_angle[j]
            turned = Rotation.from_rotvec([0.0, 0.0, motion.gimbal_angle[j]])
            gimbal = units.axes_X[j] @ turned.as_matrix()
            x, y, z = (gimbal @ units.bearing_G[j]).T
            each = np.zeros((2, 3))
            for order, component, size, phase, sense in lines:
                passed = self._passed(j, component, order * speed, sense, speed)
                value = passed * size * speed**2 * np.exp(1j * (order * angle + phase))
                # forward: y cos + z sin of the line's angle
                along = x * value.real
                if component.startswith("radial"):
                    along = y * value.real + sense * z * value.imag
                each[int(component.endswith("torque"))] += along
            arm, host = units.position_X[j] + gimbal @ units.rotor_centre_G[j], units.host[j]
            on_X = np.stack([each[0], each[1] + np.cross(arm, each[0])])
            total[host] += on_X @ R_NX[host].T
        return total

    def _passed(self, j: int, component: str, omega: float, sense: int, speed: float) -> complex:
        """Share of a line at the rotor that reaches the gimbal: an oscillator on its bearing."""
        kind = {"radial_force": "radial", "axial_force": "axial", "radial_torque": "rocking"}
        mode = self._modes[j].get(kind.get(component, ""))
        if mode is None:
            return 1.0
        natural = 2.0 * np.pi * mode["frequency"]
        bearing = natural**2 + 2j * mode["damping"] * natural * omega  # over mass or inertia
        whirl = 0.0
        if component == "radial_torque":  # a tilting rotor is a gyroscope
            spin, *across = np.diag(self._mechanism.units.rotor.inertia[j])
            whirl = sense * spin / np.mean(across) * speed * omega
        return bearing / (bearing - omega**2 + whirl)


def _lines(table: Data | None, unit: int) -> list[tuple[float, str, float, float, int]]:
    """Order, component, coefficient, phase and sense (1 with the rotor, -1 against) of each line.

    Random phases are drawn as docs/scenario.md says: for every line, six, by seed and unit.
    """
    found: list[tuple[float, str, float, float, int]] = []
    if table is None:
        return found
    orders = table.get("orders") or []
    drawn = np.random.default_rng([table["seed"], unit]).uniform(-np.pi, np.pi, (len(orders), 6))
    for line, any_phase in zip(orders, drawn, strict=True):
        forward = line["whirl"] == "forward"
        channel = {"axial_force": 2, "axial_torque": 5}
        channel |= {"radial_force": 0 if forward else 1, "radial_torque": 3 if forward else 4}
        for component in COMPONENTS:
            phase = line["phase"]
            phase = phase[component] if isinstance(phase, dict) else phase
            at = any_phase[channel[component]] if phase == "random" else phase
            if line[component]:
                found.append((line["order"], component, line[component], at, 1 if forward else -1))
    return found


class GimbalLines:
    """Accelerations of the gimbals by their motors' ripple and steps."""

    def __init__(self, data: Data, mechanism: Mechanism) -> None:
        inertia = _about_gimbal(mechanism)
        self._motors = [
            (block.units, GimbalMotors(block, inertia[block.units]))
            for block in blocks(data)
            if "gimbal_motor" in block.data
        ]

    def acceleration(self, motion: Motion) -> np.ndarray:
        """Of each gimbal [rad/s^2]."""
        total = np.zeros(len(motion.gimbal_angle))
        for units, motors in self._motors:
            each = motors.acceleration(motion.gimbal_angle[units], motion.gimbal_rate[units])
            total[units] = each
        return total


class GimbalMotors:
    """Those of one block of CMGs."""

    def __init__(self, block: Block, inertia: np.ndarray) -> None:
        """``inertia``: (unit,) about the gimbal axes [kg m^2]."""
        self._motor, self._inertia = block.data["gimbal_motor"], inertia
        bandwidth = block.data["gimbal_bandwidth"]
        self._holding = self._motor.get("holding_bandwidth", 0.1 * bandwidth)
        # phases (unit, line) of ripple and, last, of the steps
        said = [line["phase"] for line in self._motor.get("ripple", [])]
        said.append(self._motor["stepping"]["phase"] if "stepping" in self._motor else 0.0)
        drawn = [
            random_angles(seed_of(unit), j, 3, len(said))
            for j, unit in enumerate(unit_data(block.data), block.units.start)
        ]
        self._phase = np.array(
            [
                [own if s == "random" else s for s, own in zip(said, row, strict=True)]
                for row in drawn
            ]
        )

    def acceleration(self, angle: np.ndarray, rate: np.ndarray) -> np.ndarray:
        """Of each gimbal [rad/s^2] at its angle [rad] and rate [rad/s]."""
        total = np.zeros(len(angle))
        for i, line in enumerate(self._motor.get("ripple", [])):
            n = line["per_turn"]
            omega2 = (n * rate) ** 2
            free = omega2 / (omega2 + self._holding**2)
            total += free * line["torque"] / self._inertia * np.cos(n * angle + self._phase[:, i])
        stepping = self._motor.get("stepping")
        if stepping is None:
            return total
        natural = 2.0 * np.pi * stepping["frequency"]
        for k in range(1, stepping["harmonics"] + 1):
            n = k * stepping["steps_per_turn"]
            omega = n * rate  # the saw tooth sum of sin(n gamma) 2 / n, as an oscillator follows it
            follows = natural**2 / (
                natural**2 - omega**2 + 2j * stepping["damping"] * natural * omega
            )
            turned = 2.0 / n * follows * np.exp(1j * (n * angle + k * self._phase[:, -1]))
            total -= omega**2 * turned.imag
        return total


def _about_gimbal(mechanism: Mechanism) -> np.ndarray:
    """Inertia (unit,) [kg m^2] of gimbal body and balanced rotor about the gimbal axis."""
    units = mechanism.units
    body = units.gimbal.inertia[:, 2, 2] + units.gimbal.mass * _square(units.gimbal.centre)
    tilt = units.bearing_G[:, 2, 0]  # gimbal axis along the spin axis
    across = 0.5 * (units.rotor.inertia[:, 1, 1] + units.rotor.inertia[:, 2, 2])
    rotor = units.rotor.inertia[:, 0, 0] * tilt**2 + across * (1.0 - tilt**2)
    return body + rotor + units.rotor.mass * _square(units.rotor_centre_G)


def _square(r: np.ndarray) -> np.ndarray:
    """Distance from the gimbal axis, squared."""
    return np.sum(r[:, :2] ** 2, axis=1)
