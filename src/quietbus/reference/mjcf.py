"""The satellite as a MuJoCo model.

Bus and plate are free bodies, or the plate is welded to the bus (``mount: rigid``). Each CMG is a
gimbal body on a hinge in the plate and a rotor on a hinge in the gimbal body; a huge armature on
these hinges prescribes their motion while the motor's reaction still acts. Of reaction wheels the
housing, without a hinge, is the gimbal body. The legs are

- ``tendons``: massless struts between two points, exact for legs without mass and joint friction;
- ``bodies``: trees on the bus, universal joint (hinge about the fixed axis k, hinge about the
  moving axis y = k x s), lower part, slide along s, upper part. What holds a leg's tip to the
  plate is a ``connect`` constraint, which is soft in MuJoCo: good for looking at the motion, with
  errors of some 0.1 mm. ``quietbus.reference.multibody`` closes the legs exactly instead. The
  friction of the spherical joints has no counterpart in the file.

Loads and control are not part of the file; gimbals and rotors keep their rates, unless a torque of
``ARMATURE`` times an acceleration is applied to a hinge.
"""

import xml.etree.ElementTree as ET
from typing import Literal

import numpy as np
from scipy.spatial.transform import Rotation

from quietbus.reference.mechanism import LegParts, Mechanism, cross, unit
from quietbus.reference.motion import Motion, matrix

LegModel = Literal["tendons", "bodies"]

ARMATURE = 1e12
"""Reflected inertia [kg m^2] on the hinges of gimbals and rotors."""

LEAST_MASS = 1e-12
"""MuJoCo moves no body without mass [kg] or inertia [kg m^2]: massless leg parts get this."""

COLORS = {"bus": ".75 .68 .45 1", "plate": ".55 .6 .66 .6", "gimbal": ".3 .45 .6 .5"}
COLORS |= {"rotor": ".75 .3 .2 1", "lower": ".3 .3 .32 1", "upper": ".8 .8 .82 1"}


def write_mjcf(
    mechanism: Mechanism,
    motion: Motion,
    legs: LegModel = "tendons",
    timestep: float = 1e-4,
) -> str:
    """MuJoCo XML of the satellite; the keyframe ``start`` holds the motion.

    Args:
        motion: at the keyframe.
        legs: massless springs and dampers, or bodies (see above).
        timestep: of MuJoCo's fourth-order Runge-Kutta integrator [s].
    """
    root = ET.Element("mujoco", model="quietbus")
    ET.SubElement(root, "compiler", angle="radian", balanceinertia="false", inertiafromgeom="false")
    option = ET.SubElement(
        root, "option", gravity="0 0 0", integrator="RK4", timestep=repr(float(timestep))
    )
    ET.SubElement(option, "flag", contact="disable")
    visual = ET.SubElement(root, "visual")
    ET.SubElement(visual, "map", zfar="100", znear="0.01")
    world = ET.SubElement(root, "worldbody")
    ET.SubElement(world, "light", pos="2 -2 4", dir="-0.4 0.4 -0.8", directional="true")

    bus = _free_body(world, "bus", motion.p_NB_N, motion.q_NB)
    _inertial(bus, mechanism.bus.mass, mechanism.bus.centre, mechanism.bus.inertia)
    for i, joint in enumerate(mechanism.legs.lower_joint_B):
        ET.SubElement(bus, "site", name=f"A{i}", pos=_text(joint), size="0.01")
    if legs == "bodies":
        _leg_bodies(bus, mechanism)
    if mechanism.mount == "rigid":
        pose = {"pos": _text(mechanism.p_BP_B), "quat": _matrix_quaternion(mechanism.R_BP)}
        plate = ET.SubElement(bus, "body", pose | {"name": "plate"})
    else:
        plate = _free_body(world, "plate", motion.p_NP_N, motion.q_NP)
    _inertial(plate, mechanism.plate.mass, mechanism.plate.centre, mechanism.plate.inertia)
    for i, joint in enumerate(mechanism.legs.upper_joint_P):
        ET.SubElement(plate, "site", name=f"U{i}", pos=_text(joint), size="0.01")
    ET.SubElement(plate, "body", name="plate_origin")  # MuJoCo's xfrc_applied acts at its origin
    _cluster(plate, mechanism)
    _bus_and_plate_shapes(bus, plate, mechanism)

    if legs == "tendons":
        _tendons(root, mechanism)
    else:
        equality = ET.SubElement(root, "equality")
        for i in range(len(mechanism.legs.stiffness)):
            ET.SubElement(
                equality,
                "connect",
                name=f"tip{i}",
                site1=f"tip{i}",
                site2=f"U{i}",
                solref=_text([2.0 * timestep, 1.0]),  # as hard as MuJoCo allows
                solimp="0.9999 0.9999 0.001",
            )
    values = coordinates(mechanism, motion)
    order = [e.get("name", "") for e in world.iter() if e.tag in ("joint", "freejoint")]
    ET.SubElement(
        ET.SubElement(root, "keyframe"),
        "key",
        name="start",
        qpos=_text(np.concatenate([values[name][0] for name in order])),
        qvel=_text(np.concatenate([values[name][1] for name in order])),
    )
    ET.indent(root)
    return ET.tostring(root, encoding="unicode") + "\n"


def coordinates(mechanism: Mechanism, motion: Motion) -> dict[str, tuple[np.ndarray, np.ndarray]]:
    """MuJoCo's positions and velocities of every joint in ``write_mjcf``'s models.

    Of a free joint: origin [m] and quaternion; velocity [m/s] in inertial and angular velocity
    [rad/s] in body components. Of hinges rad and rad/s, of slides m and m/s.
    """
    values = {
        "bus": (
            np.concatenate([motion.p_NB_N, motion.q_NB]),
            np.concatenate([motion.v_NB_N, motion.w_NB_B]),
        ),
        "plate": (
            np.concatenate([motion.p_NP_N, motion.q_NP]),
            np.concatenate([motion.v_NP_N, motion.w_NP_P]),
        ),
    }
    for j in range(len(motion.rotor_angle)):
        one = slice(j, j + 1)
        if not mechanism.units.wheels:
            values[f"gimbal{j}"] = motion.gimbal_angle[one], motion.gimbal_rate[one]
        values[f"rotor{j}"] = motion.rotor_angle[one], motion.rotor_speed[one]
    positions, rates = leg_coordinates(mechanism, motion)
    for i, (position, rate) in enumerate(zip(positions, rates, strict=True)):
        for joint, q, dq in zip(LEG_JOINTS, position, rate, strict=True):
            values[f"leg{i}_{joint}"] = (np.array([q]), np.array([dq]))
    return values


LEG_JOINTS = ("k", "y", "slide")


def leg_coordinates(mechanism: Mechanism, motion: Motion) -> tuple[np.ndarray, np.ndarray]:
    """Positions and rates (leg, 3) of each leg's two hinges [rad] and slide [m].

    They follow from where both plates are.
    """
    R_NB, R_NP = matrix(motion.q_NB), matrix(motion.q_NP)
    A, U = mechanism.legs.lower_joint_B, mechanism.legs.upper_joint_P
    span = (motion.p_NP_N - motion.p_NB_N + U @ R_NP.T) @ R_NB - A
    v_PU_N = motion.v_NP_N + cross(motion.w_NP_P, U) @ R_NP.T
    # velocity of the leg's upper end as seen from the bus
    rate = (v_PU_N - motion.v_NB_N) @ R_NB - cross(motion.w_NB_B, A + span)
    k, (nominal, s0, y0) = mechanism.legs.axis_B, mechanism.nominal_legs
    length, s = np.linalg.norm(span, axis=1), unit(span)
    y = unit(cross(k, s))
    about_k = _angle(y0, y, k)
    cos, sin = np.cos(about_k)[:, None], np.sin(about_k)[:, None]
    along = np.sum(k * s, axis=1, keepdims=True) * k
    before_k = cos * (s - along) - sin * cross(k, s) + along  # s turned back about k
    about_y = _angle(s0, before_k, y0)
    # rate = alpha k x span + beta y x span + dl/dt s
    axes = np.stack([cross(k, span), cross(y, span), s], axis=2)
    joint_rates = np.linalg.solve(axes, rate[:, :, None])[:, :, 0]
    slide = length - nominal
    return np.stack([about_k, about_y, slide], axis=1), joint_rates


def _leg_bodies(bus: ET.Element, mechanism: Mechanism) -> None:
    """Legs as trees on the bus; all joint positions are zero in the plate's nominal pose."""
    legs = mechanism.legs
    for i, span_B in enumerate(mechanism.spans_B):
        length, k = float(np.linalg.norm(span_B)), legs.axis_B[i]
        frame = _leg_frame(k, span_B)
        friction = repr(float(legs.universal_friction[i]))
        lower = ET.SubElement(
            bus,
            "body",
            name=f"lower{i}",
            pos=_text(legs.lower_joint_B[i]),
            quat=_matrix_quaternion(frame),
        )
        for joint, axis in (("k", frame.T @ k), ("y", np.array([0.0, 1.0, 0.0]))):
            ET.SubElement(
                lower,
                "joint",
                name=f"leg{i}_{joint}",
                type="hinge",
                axis=_text(axis),
                damping=friction,
            )
        _leg_part(lower, legs.lower, i, 1.0)
        _shape(lower, "lower", "capsule", fromto=f"0 0 0 0 0 {0.55 * length}", size="0.016")
        upper = ET.SubElement(lower, "body", name=f"upper{i}", pos=_text([0.0, 0.0, length]))
        ET.SubElement(
            upper,
            "joint",
            name=f"leg{i}_slide",
            type="slide",
            axis="0 0 1",
            stiffness=repr(float(legs.stiffness[i])),
            damping=repr(float(legs.damping[i])),
            springref=repr(float(legs.free_length[i] - length)),
        )
        _leg_part(upper, legs.upper, i, -1.0)
        ET.SubElement(upper, "site", name=f"tip{i}", size="0.01")
        _shape(upper, "upper", "capsule", fromto=f"0 0 0 0 0 {-0.55 * length}", size="0.01")


def _leg_part(body: ET.Element, parts: LegParts, i: int, side: float) -> None:
    """Inertia of one leg part, its mass centre along the leg (z) on the given side of its joint."""
    across = max(float(parts.transverse_inertia[i]), LEAST_MASS)
    along = max(float(parts.axial_inertia[i]), LEAST_MASS)
    centre = np.array([0.0, 0.0, side * float(parts.distance[i])])
    mass = max(float(parts.mass[i]), LEAST_MASS)
    _inertial(body, mass, centre, np.diag([across, across, along]))


def _tendons(root: ET.Element, mechanism: Mechanism) -> None:
    tendon = ET.SubElement(root, "tendon")
    legs = mechanism.legs
    for i in range(len(legs.stiffness)):
        spatial = ET.SubElement(
            tendon,
            "spatial",
            name=f"leg{i}",
            width="0.012",
            stiffness=repr(float(legs.stiffness[i])),
            damping=repr(float(legs.damping[i])),
            springlength=repr(float(legs.free_length[i])),
        )
        ET.SubElement(spatial, "site", site=f"A{i}")
        ET.SubElement(spatial, "site", site=f"U{i}")


def _cluster(plate: ET.Element, mechanism: Mechanism) -> None:
    units = mechanism.units
    for j in range(len(units.speed)):
        gimbal = ET.SubElement(
            plate,
            "body",
            name=f"gimbal{j}",
            pos=_text(units.position_P[j]),
            quat=_matrix_quaternion(units.axes_P[j]),
        )
        if not units.wheels:
            _hinge(gimbal, f"gimbal{j}", "0 0 1")
        _inertial(gimbal, units.gimbal.mass[j], units.gimbal.centre[j], units.gimbal.inertia[j])
        _shape(gimbal, "gimbal", "cylinder", fromto="0 0 -0.12 0 0 0.12", size="0.02")
        rotor = ET.SubElement(
            gimbal,
            "body",
            name=f"rotor{j}",
            pos=_text(units.rotor_centre_G[j]),
            quat=_matrix_quaternion(units.bearing_G[j]),
        )
        _hinge(rotor, f"rotor{j}", "1 0 0")
        _inertial(rotor, units.rotor.mass[j], units.rotor.centre[j], units.rotor.inertia[j])
        _shape(rotor, "rotor", "cylinder", fromto="-0.02 0 0 0.02 0 0", size="0.08")


def _bus_and_plate_shapes(bus: ET.Element, plate: ET.Element, mechanism: Mechanism) -> None:
    """A box with the universal joints on its faces, and a disk under the spherical joints."""
    half = np.maximum(np.abs(mechanism.legs.lower_joint_B).max(axis=0), 0.1)
    _shape(bus, "bus", "box", size=_text(half))
    radius = np.linalg.norm(mechanism.legs.upper_joint_P, axis=1).max()
    _shape(plate, "plate", "cylinder", size=_text([radius, 0.01]))


def _free_body(world: ET.Element, name: str, p_NX_N: object, q_NX: object) -> ET.Element:
    body = ET.SubElement(world, "body", name=name, pos=_text(p_NX_N), quat=_text(q_NX))
    ET.SubElement(body, "freejoint", name=name)
    return body


def _hinge(body: ET.Element, name: str, axis: str) -> None:
    ET.SubElement(body, "joint", name=name, type="hinge", axis=axis, armature=repr(ARMATURE))


def _inertial(body: ET.Element, mass: object, centre: object, inertia: object) -> None:
    I = np.asarray(inertia)
    six = [I[0, 0], I[1, 1], I[2, 2], I[0, 1], I[0, 2], I[1, 2]]
    ET.SubElement(body, "inertial", pos=_text(centre), mass=_text([mass]), fullinertia=_text(six))


def _shape(body: ET.Element, color: str, kind: str, **where: str) -> None:
    """Something to see, without mass or contact."""
    look = {"type": kind, "rgba": COLORS[color], "mass": "0", "contype": "0", "conaffinity": "0"}
    ET.SubElement(body, "geom", look | where)


def _leg_frame(k: np.ndarray, span: np.ndarray) -> np.ndarray:
    """Axes x, y = k x s normalised, z = s of a leg, as columns."""
    s, y = unit(span), unit(cross(k, span))
    return np.stack([cross(y, s), y, s], axis=1)


def _angle(a: np.ndarray, b: np.ndarray, axis: np.ndarray) -> np.ndarray:
    """Angles [rad] that take a to b about the axis, all unit and the axis normal to both."""
    return np.arctan2(np.sum(cross(a, b) * axis, axis=-1), np.sum(a * b, axis=-1))


def _matrix_quaternion(R: np.ndarray) -> str:
    return _text(Rotation.from_matrix(R).as_quat(scalar_first=True))


def _text(values: object) -> str:
    return " ".join(repr(float(value)) for value in np.asarray(values, dtype=float).ravel())
