"""The satellite as a MuJoCo model.

All bodies are free, or welded to the bus (``mount: rigid``). Each CMG is a gimbal body on a hinge
in the body that carries it and a rotor on a hinge in the gimbal body; a huge armature on these
hinges prescribes their motion while the motor's reaction still acts. Of reaction wheels the
housing, without a hinge, is the gimbal body. The legs are

- ``tendons``: massless struts between two points, exact for legs without mass and joint friction;
- ``bodies``: trees on the lower body, universal joint (hinge about the fixed axis k, hinge about
  the moving axis y = k x s), lower part, slide along s, upper part. What holds a leg's tip to the
  upper body is a ``connect`` constraint, which is soft in MuJoCo: good for looking at the motion,
  with errors of some 0.1 mm. ``quietbus.reference.multibody`` closes the legs exactly instead. The
  friction of the spherical joints has no counterpart in the file.

Loads and control are not part of the file; gimbals and rotors keep their rates, unless a torque of
``ARMATURE`` times an acceleration is applied to a hinge.
"""

import xml.etree.ElementTree as ET
from typing import Literal

import numpy as np
from scipy.spatial.transform import Rotation

from quietbus.reference.body import Body
from quietbus.reference.mechanism import LegParts, Mechanism, apply, cross, unit
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

    bodies = _bodies(world, mechanism, motion)
    for i, (lower, upper) in enumerate(_of_legs(mechanism, bodies)):
        for body, letter, joints in (
            (lower, "A", mechanism.legs.lower_joint_Y),
            (upper, "U", mechanism.legs.upper_joint_X),
        ):
            ET.SubElement(body, "site", name=f"{letter}{i}", pos=_text(joints[i]), size="0.01")
        if legs == "bodies":
            _leg_bodies(lower, mechanism, i)
    for j, host in enumerate(mechanism.units.host):
        _unit(bodies[host], mechanism, j)
    _shapes(bodies, mechanism)

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
    poses, speeds = free_coordinates(motion)
    values = {name: (poses[number], speeds[number]) for number, name in enumerate(mechanism.names)}
    for j in range(len(motion.rotor_angle)):
        one = slice(j, j + 1)
        if not mechanism.units.wheel[j]:
            values[f"gimbal{j}"] = motion.gimbal_angle[one], motion.gimbal_rate[one]
        values[f"rotor{j}"] = motion.rotor_angle[one], motion.rotor_speed[one]
    positions, rates = leg_coordinates(mechanism, motion)
    for i, (position, rate) in enumerate(zip(positions, rates, strict=True)):
        for joint, q, dq in zip(LEG_JOINTS, position, rate, strict=True):
            values[f"leg{i}_{joint}"] = (np.array([q]), np.array([dq]))
    return values


def free_coordinates(motion: Motion) -> tuple[np.ndarray, np.ndarray]:
    """Positions (body, 7) and velocities (body, 6) of the bodies as MuJoCo has them."""
    return (
        np.concatenate([motion.p_NX_N, motion.q_NX], axis=1),
        np.concatenate([motion.v_NX_N, motion.w_NX_X], axis=1),
    )


LEG_JOINTS = ("k", "y", "slide")


def leg_coordinates(mechanism: Mechanism, motion: Motion) -> tuple[np.ndarray, np.ndarray]:
    """Positions and rates (leg, 3) of each leg's two hinges [rad] and slide [m].

    They follow from where both bodies are.
    """
    legs, R = mechanism.legs, matrix(motion.q_NX)
    low, up = legs.lower_body, legs.upper_body
    A, U, R_YN = legs.lower_joint_Y, legs.upper_joint_X, np.swapaxes(R[low], 1, 2)
    top_N = motion.p_NX_N[up] + apply(R[up], U)
    v_top_N = motion.v_NX_N[up] + apply(R[up], cross(motion.w_NX_X[up], U))
    span = apply(R_YN, top_N - motion.p_NX_N[low]) - A
    # velocity of the leg's upper end as seen from the lower body
    rate = apply(R_YN, v_top_N - motion.v_NX_N[low]) - cross(motion.w_NX_X[low], A + span)
    k, (nominal, s0, y0) = legs.axis_Y, mechanism.nominal_legs
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


def _leg_bodies(body: ET.Element, mechanism: Mechanism, i: int) -> None:
    """Leg i as a tree on its lower body; all joint positions are zero in the nominal pose."""
    legs, span = mechanism.legs, mechanism.spans_Y[i]
    length, k = float(np.linalg.norm(span)), legs.axis_Y[i]
    frame = _leg_frame(k, span)
    friction = repr(float(legs.universal_friction[i]))
    lower = ET.SubElement(
        body,
        "body",
        name=f"lower{i}",
        pos=_text(legs.lower_joint_Y[i]),
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
    inertia = np.diag([across, across, along])
    _inertial(body, Body(np.array([mass]), centre[None], inertia[None]), 0)


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


def _unit(body: ET.Element, mechanism: Mechanism, j: int) -> None:
    """Unit j on the body that carries it."""
    units = mechanism.units
    gimbal = ET.SubElement(
        body,
        "body",
        name=f"gimbal{j}",
        pos=_text(units.position_X[j]),
        quat=_matrix_quaternion(units.axes_X[j]),
    )
    if not units.wheel[j]:
        _hinge(gimbal, f"gimbal{j}", "0 0 1")
    _inertial(gimbal, units.gimbal, j)
    _shape(gimbal, "gimbal", "cylinder", fromto="0 0 -0.12 0 0 0.12", size="0.02")
    rotor = ET.SubElement(
        gimbal,
        "body",
        name=f"rotor{j}",
        pos=_text(units.rotor_centre_G[j]),
        quat=_matrix_quaternion(units.bearing_G[j]),
    )
    _hinge(rotor, f"rotor{j}", "1 0 0")
    _inertial(rotor, units.rotor, j)
    _shape(rotor, "rotor", "cylinder", fromto="-0.02 0 0 0.02 0 0", size="0.08")


def _shapes(bodies: list[ET.Element], mechanism: Mechanism) -> None:
    """A box with the universal joints on the bus's faces, disks under the spherical joints."""
    legs = mechanism.legs
    half = np.maximum(np.abs(legs.lower_joint_Y[legs.lower_body == 0]).max(axis=0), 0.1)
    _shape(bodies[0], "bus", "box", size=_text(half))
    for number in np.unique(legs.upper_body):
        tops = legs.upper_joint_X[legs.upper_body == number]
        radius = np.linalg.norm(tops, axis=1).max()
        _shape(bodies[number], "plate", "cylinder", size=_text([radius, 0.01]))


def _bodies(world: ET.Element, mechanism: Mechanism, motion: Motion) -> list[ET.Element]:
    """All bodies: free in the world, or welded to the bus."""
    found: list[ET.Element] = []
    for number, name in enumerate(mechanism.names):
        if mechanism.welded[number]:
            pose = {
                "pos": _text(mechanism.p_BX_B[number]),
                "quat": _matrix_quaternion(mechanism.R_BX[number]),
            }
            body = ET.SubElement(found[0], "body", pose | {"name": name})
        else:
            pose = {"pos": _text(motion.p_NX_N[number]), "quat": _text(motion.q_NX[number])}
            body = ET.SubElement(world, "body", pose | {"name": name})
            ET.SubElement(body, "freejoint", name=name)
        _inertial(body, mechanism.bodies, number)
        # MuJoCo's xfrc_applied acts at a mass centre: that of this empty body is the origin
        ET.SubElement(body, "body", name=f"{name}_origin")
        found.append(body)
    return found


def _of_legs(mechanism: Mechanism, bodies: list[ET.Element]) -> list[tuple[ET.Element, ET.Element]]:
    """Lower and upper body of each leg."""
    legs = mechanism.legs
    return [
        (bodies[low], bodies[up]) for low, up in zip(legs.lower_body, legs.upper_body, strict=True)
    ]


def _hinge(body: ET.Element, name: str, axis: str) -> None:
    ET.SubElement(body, "joint", name=name, type="hinge", axis=axis, armature=repr(ARMATURE))


def _inertial(element: ET.Element, body: Body, number: int) -> None:
    I = body.inertia[number]
    six = [I[0, 0], I[1, 1], I[2, 2], I[0, 1], I[0, 2], I[1, 2]]
    where, mass = _text(body.centre[number]), _text([body.mass[number]])
    ET.SubElement(element, "inertial", pos=where, mass=mass, fullinertia=_text(six))


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
