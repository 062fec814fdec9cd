"""What a run holds: names, dimensions, units and meanings of its variables."""

AXES = ("x", "y", "z")
PAIRS = ("yz", "zx", "xy")
DIMENSIONS = {
    "axis": ("axis", list(AXES), "component"),
    "quaternion": ("quaternion", ["w", "x", "y", "z"], "component, scalar first"),
}
# name: (dimensions after time, unit, meaning)
VARIABLES: dict[str, tuple[tuple[str, ...], str, str]] = {
    "bus_position": (("axis",), "m", "position of the bus mass centre, inertial frame"),
    "bus_velocity": (("axis",), "m/s", "velocity of the bus mass centre, inertial frame"),
    "bus_attitude": (("quaternion",), "1", "attitude of the bus in the inertial frame"),
    "bus_rate": (("axis",), "rad/s", "angular velocity of the bus, bus frame"),
    "platform_position": (("axis",), "m", "position of the upper plate's origin, inertial frame"),
    "platform_velocity": (("axis",), "m/s", "velocity of the upper plate's origin, inertial frame"),
    "platform_attitude": (
        ("quaternion",),
        "1",
        "attitude of the upper plate in the inertial frame",
    ),
    "platform_rate": (("axis",), "rad/s", "angular velocity of the upper plate, plate frame"),
    "gimbal_angle": (("cmg",), "rad", "gimbal angles"),
    "gimbal_rate": (("cmg",), "rad/s", "gimbal rates"),
    "leg_stroke": (("leg",), "m", "leg length less its nominal length"),
    "leg_force": (("leg",), "N", "force of spring and damper, tension positive"),
    "control_torque": (("axis",), "N m", "commanded torque on the bus, bus frame"),
    "attitude_error": (
        ("axis",),
        "rad",
        "twice the vector part of the shortest error quaternion, bus frame",
    ),
    "singularity_measure": (
        (),
        "1",
        "sqrt(det(A A^T)) of the cluster's torque directions, weighted by momentum",
    ),
}
# of runs in which the control makes units act
CONTROL_VARIABLES: dict[str, tuple[tuple[str, ...], str, str]] = {
    "torque_share": ((), "1", "part of the control torque that is delivered along it"),
}
# of runs whose rotor speeds change
ROTOR_VARIABLES: dict[str, tuple[tuple[str, ...], str, str]] = {
    "rotor_angle": (("cmg",), "rad", "rotor angles"),
    "rotor_speed": (("cmg",), "rad/s", "rotor speeds, relative to the unit's body"),
    "rotor_torque": (("cmg",), "N m", "torque of the motor on its rotor"),
}
WORST_PHASES = "worst_phases_rate"  # of runs that a command has written
JOINT_VARIABLES = {
    "spherical_force": (
        ("leg", "axis"),
        "N",
        "plate on leg at the spherical joint, inertial frame",
    ),
    "universal_force": (("leg", "axis"), "N", "base on leg at the universal joint, inertial frame"),
    "universal_moment": (("leg",), "N m", "base on leg at the universal joint, about its h axis"),
    "universal_axis": (("leg", "axis"), "1", "axis of the universal moment, inertial frame"),
}
# of harmonic runs; name: (dimensions of a component, unit, meaning)
JITTER_VARIABLES: dict[str, tuple[tuple[str, ...], str, str]] = {
    "bus_rate": VARIABLES["bus_rate"],
    "bus_attitude": (("axis",), "rad", "rotation of the bus from its slow motion, bus frame"),
    "platform_rate": VARIABLES["platform_rate"],
    "leg_stroke": VARIABLES["leg_stroke"],
    "leg_force": VARIABLES["leg_force"],
    "point_acceleration": (
        ("point", "axis"),
        "m/s^2",
        "inertial acceleration of a point of the bus, bus frame",
    ),
    "line_of_sight": (
        ("line", "axis"),
        "rad",
        "motion of a line of sight, across it, bus frame",
    ),
}
COMBINED = {
    "envelope": "largest value as lines beat, phases as given",
    "worst_case": "sum of all amplitudes, any phases",
    "rss": "root of the sum of squares of all amplitudes",
    "rms": "root mean square over the second about the instant, phases as given",
}


def described(name: str) -> tuple[tuple[str, ...], str] | None:
    """Dimensions and unit of a variable by its name, None of one that no run has."""
    for table in (VARIABLES, CONTROL_VARIABLES, ROTOR_VARIABLES, JOINT_VARIABLES):
        if name in table:
            inner, unit, _ = table[name]
            return ("time", *inner), unit
    if name == WORST_PHASES:
        return ("axis",), "rad/s"
    if name == "jitter_change_error":
        return ("time",), "1"
    if name == "line_of_sight_change_error":
        return ("time", "line"), "rad"
    if name == "line_of_sight_cospectrum":
        return ("look", "frequency", "cmg", "line", "pair"), per_hertz("rad")
    for of, (inner, unit, _) in JITTER_VARIABLES.items():
        parts: dict[str, tuple[tuple[str, ...], str]] = {
            "jitter_amplitude": (("time", "cmg", "order", *inner), unit),
            "jitter_phase": (("time", "cmg", "order", *inner), "rad"),
            "ripple_amplitude": (("time", "cmg", "ripple", *inner), unit),
            "ripple_phase": (("time", "cmg", "ripple", *inner), "rad"),
            "psd": (("look", "frequency", "cmg", *inner), per_hertz(unit)),
            "noise_rms": (("time", *inner), unit),
        }
        parts |= {f"jitter_{kind}": (("time", *inner), unit) for kind in COMBINED}
        part = name.removeprefix(f"{of}_")
        if part != name and part in parts:
            return parts[part]
    return None


def per_hertz(unit: str) -> str:
    """Unit of a power spectral density."""
    return f"({unit})^2/Hz"
