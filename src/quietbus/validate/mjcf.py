"""The satellite as a MuJoCo model.

Bus and plate are free bodies, or the plate is welded to the bus (``mount: rigid``). Each CMG is a
gimbal body on a hinge in the plate and a rotor on a hinge in the gimbal body; a huge armature on
these hinges prescribes their motion while the motor's reaction still acts. Of reaction wheels the
housing, without a hinge, is the gimbal body. The legs are

- ``tendons``: massless struts between two points, exact for legs without mass and joint friction;
- ``bodies``: trees on the bus, universal joint (hinge about the fixed axis k, hinge about the
  moving axis y = k x s), lower part, slide along s, upper part. What holds a leg's tip to the
  plate is a ``connect`` constraint, which is soft in MuJoCo: good for looking at the motion, with
  errors of some 0.1 mm. ``quietbus.validate.reference`` closes the legs exactly instead. The
  friction of the spherical joints has no counterpart in the file.

Loads and control are not part of the file; gimbals and rotors keep their rates, unless a torque of
``ARMATURE`` times an acceleration is applied to a hinge.
"""

import xml.etree.ElementTree as ET
from typing import Literal

import numpy as np
from scipy.spatial.transform import Rotation

from quietbus.dynamics.state import State
from quietbus.model.hexapod import LegParts
from quietbus.model.satellite import Satellite

LegModel = Literal["tendons", "bodies"]

ARMATURE = 1e12
"""Reflected inertia [kg m^2] on the hinges of gimbals and rotors."""

LEAST_MASS = 1e-12
"""MuJoCo moves no body without mass [kg] or inertia [kg m^2]: massless leg parts get this."""

COLORS = {"bus": ".75 .68 .45 1", "plate": ".55 .6 .66 .6", "gimbal": ".3 .45 .6 .5"}
COLORS |= {"rotor": ".75 .3 .2 1", "lower": ".3 .3 .32 1", "upper": ".8 .8 .82 1"}


def write_mjcf(
    satellite: Satellite,
    state: State,
    legs: LegModel = "tendons",
    timestep: float = 1e-4,
    rotor_angle: np.ndarray | None = None,
) -> str:
    """MuJoCo XML of the satellite; the keyframe ``start`` holds the state.

    Args:
        state: motion at the keyframe.
        legs: massless springs and dampers, or bodies (see above).
        timestep: of MuJoCo's fourth-order Runge-Kutta integrator [s].
        rotor_angle: (cmg,) rotor angles at the keyframe [rad]; those at the start by default.
    """
    start = satellite.cluster.rotor_phase if state.rotor is None else state.rotor.angle
    phi = np.asarray(start if rotor_angle is None else rotor_angle)
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

    bus = _free_body(world, "bus", state.p_NB_N, state.q_NB)
    _inertial(bus, satellite.bus.mass, np.zeros(3), satellite.bus.I_BBcm_B)
    for i, p_BA_B in enumerate(np.asarray(satellite.legs.p_BA_B)):
        ET.SubElement(bus, "site", name=f"A{i}", pos=_text(p_BA_B), size="0.01")
    if legs == "bodies":
        _leg_bodies(bus, satellite)
    if satellite.mount == "rigid":
        pose = {"pos": _text(satellite.p_BP_B), "quat": _text(satellite.q_BP)}
        plate = ET.SubElement(bus, "body", pose | {"name": "plate"})
    else:
        plate = _free_body(world, "plate", state.p_NP_N, state.q_NP)
    _inertial(plate, satellite.plate.mass, satellite.plate.p_PPcm_P, satellite.plate.I_PPcm_P)
    for i, p_PU_P in enumerate(np.asarray(satellite.legs.p_PU_P)):
        ET.SubElement(plate, "site", name=f"U{i}", pos=_text(p_PU_P), size="0.01")
    ET.SubElement(plate, "body", name="plate_origin")  # MuJoCo's xfrc_applied acts at its origin
    _cluster(plate, satellite)
    _bus_and_plate_shapes(bus, plate, satellite)

    if legs == "tendons":
        _tendons(root, satellite)
    else:
        equality = ET.SubElement(root, "equality")
        for i in range(len(satellite.legs.stiffness)):
            ET.SubElement(
                equality,
                "connect",
                name=f"tip{i}",
                site1=f"tip{i}",
                site2=f"U{i}",
                solref=_text([2.0 * timestep, 1.0]),  # as hard as MuJoCo allows
                solimp="0.9999 0.9999 0.001",
            )
    values = coordinates(satellite, state, phi)
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


def coordinates(
    satellite: Satellite, state: State, rotor_angle: np.ndarray
) -> dict[str, tuple[np.ndarray, np.ndarray]]:
    """MuJoCo's positions and velocities of every joint in ``write_mjcf``'s models.

    Of a free joint: origin [m] and quaternion; velocity [m/s] in inertial and angular velocity
    [rad/s] in body components. Of hinges rad and rad/s, of slides m and m/s.
    """
    q_NB, q_NP = np.asarray(state.q_NB), np.asarray(state.q_NP)
    values = {
        "bus": (
            np.concatenate([state.p_NB_N, q_NB]),
            np.concatenate([state.v_NB_N, state.w_NB_B]),
        ),
        "plate": (
            np.concatenate([state.p_NP_N, q_NP]),
            np.concatenate([state.v_NP_N, state.w_NP_P]),
        ),
    }
    cluster = satellite.cluster
    speeds = cluster.rotor_speed if state.rotor is None else state.rotor.speed
    for j, speed in enumerate(np.asarray(speeds)):
        if not cluster.wheels:
            values[f"gimbal{j}"] = (
                np.asarray(state.gimbal_angle)[j : j + 1],
                np.asarray(state.gimbal_rate)[j : j + 1],
            )
        values[f"rotor{j}"] = (rotor_angle[j : j + 1], np.array([speed]))

    R_NB, R_NP = _rotation(q_NB).as_matrix(), _rotation(q_NP).as_matrix()
    p_BA_B, p_PU_P = np.asarray(satellite.legs.p_BA_B), np.asarray(satellite.legs.p_PU_P)
    p_BP_N = np.asarray(state.p_NP_N) - np.asarray(state.p_NB_N)
    w_NB_B = np.asarray(state.w_NB_B)
    span_B = (p_BP_N + p_PU_P @ R_NP.T) @ R_NB - p_BA_B
    v_PU_N = np.asarray(state.v_NP_N) + np.cross(np.asarray(state.w_NP_P), p_PU_P) @ R_NP.T
    # velocity of the leg's upper end as seen from the bus
    span_rate_B = (v_PU_N - np.asarray(state.v_NB_N)) @ R_NB - np.cross(w_NB_B, p_BA_B + span_B)
    zero_span_B = nominal_spans_B(satellite)
    for i, k in enumerate(np.asarray(satellite.legs.k_B)):
        frame0 = _leg_frame(k, zero_span_B[i])
        span, rate = span_B[i], span_rate_B[i]
        length, s = np.linalg.norm(span), span / np.linalg.norm(span)
        y0, y = frame0[:, 1], np.cross(k, s) / np.linalg.norm(np.cross(k, s))
        about_k = _angle(y0, y, k)
        before_k = Rotation.from_rotvec(-about_k * k).apply(s)
        about_y = _angle(frame0[:, 2], before_k, y0)
        # rate = alpha k x span + beta y x span + dl/dt s, and k x s is normal to y x s
        axes = np.stack([np.cross(k, span), np.cross(y, span), s], axis=1)
        joint_rates = np.linalg.solve(axes, rate)
        positions = (about_k, about_y, length - np.linalg.norm(zero_span_B[i]))
        for joint, q, dq in zip(("k", "y", "slide"), positions, joint_rates, strict=True):
            values[f"leg{i}_{joint}"] = (np.array([q]), np.array([dq]))
    return values


def _leg_bodies(bus: ET.Element, satellite: Satellite) -> None:
    """Legs as trees on the bus; all joint positions are zero in the plate's nominal pose."""
    legs = satellite.legs
    for i, span_B in enumerate(nominal_spans_B(satellite)):
        length, k = float(np.linalg.norm(span_B)), np.asarray(legs.k_B)[i]
        frame = _leg_frame(k, span_B)
        friction = repr(float(legs.universal_friction[i]))
        lower = ET.SubElement(
            bus,
            "body",
            name=f"lower{i}",
            pos=_text(legs.p_BA_B[i]),
            quat=_text(Rotation.from_matrix(frame).as_quat(scalar_first=True)),
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


def _tendons(root: ET.Element, satellite: Satellite) -> None:
    tendon = ET.SubElement(root, "tendon")
    legs = satellite.legs
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


def _cluster(plate: ET.Element, satellite: Satellite) -> None:
    cluster = satellite.cluster
    for j in range(len(cluster.rotor_speed)):
        gimbal = ET.SubElement(
            plate,
            "body",
            name=f"gimbal{j}",
            pos=_text(cluster.p_PC_P[j]),
            quat=_matrix_quaternion(cluster.R_PG0[j]),
        )
        if not cluster.wheels:
            _hinge(gimbal, f"gimbal{j}", "0 0 1")
        _inertial(gimbal, cluster.gimbal_mass[j], cluster.p_CGcm_G[j], cluster.I_GGcm_G[j])
        _shape(gimbal, "gimbal", "cylinder", fromto="0 0 -0.12 0 0 0.12", size="0.02")
        rotor = ET.SubElement(
            gimbal,
            "body",
            name=f"rotor{j}",
            pos=_text(cluster.p_CR_G[j]),
            quat=_matrix_quaternion(cluster.R_GF[j]),
        )
        _hinge(rotor, f"rotor{j}", "1 0 0")
        e_R = np.array([0.0, float(cluster.eccentricity[j]), 0.0])
        _inertial(rotor, cluster.rotor_mass[j], e_R, cluster.I_RRcm_R[j])
        _shape(rotor, "rotor", "cylinder", fromto="-0.02 0 0 0.02 0 0", size="0.08")


def _bus_and_plate_shapes(bus: ET.Element, plate: ET.Element, satellite: Satellite) -> None:
    """A box with the universal joints on its faces, and a disk under the spherical joints."""
    half = np.maximum(np.abs(np.asarray(satellite.legs.p_BA_B)).max(axis=0), 0.1)
    _shape(bus, "bus", "box", size=_text(half))
    radius = np.linalg.norm(np.asarray(satellite.legs.p_PU_P), axis=1).max()
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


def nominal_spans_B(satellite: Satellite) -> np.ndarray:
    """Vectors from universal to spherical joints [m] in the plate's nominal pose, bus frame."""
    R_BP = _rotation(satellite.q_BP).as_matrix()
    p_BU_B = np.asarray(satellite.p_BP_B) + np.asarray(satellite.legs.p_PU_P) @ R_BP.T
    return p_BU_B - np.asarray(satellite.legs.p_BA_B)


def _leg_frame(k: np.ndarray, span: np.ndarray) -> np.ndarray:
    """Axes x, y = k x s normalised, z = s of a leg, as columns."""
    s = span / np.linalg.norm(span)
    y = np.cross(k, s) / np.linalg.norm(np.cross(k, s))
    return np.stack([np.cross(y, s), y, s], axis=1)


def _angle(a: np.ndarray, b: np.ndarray, axis: np.ndarray) -> float:
    """Angle [rad] that takes a to b about the axis, all unit and the axis normal to both."""
    return float(np.arctan2(np.cross(a, b) @ axis, a @ b))


def _rotation(q: object) -> Rotation:
    return Rotation.from_quat(np.asarray(q), scalar_first=True)


def _matrix_quaternion(R: object) -> str:
    return _text(Rotation.from_matrix(np.asarray(R)).as_quat(scalar_first=True))


def _text(values: object) -> str:
    return " ".join(repr(float(value)) for value in np.asarray(values, dtype=float).ravel())
