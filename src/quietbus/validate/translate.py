"""Between quietbus's objects and the plain arrays of the reference.

Bodies go by their order in the satellite, units by theirs through all clusters.
"""

from dataclasses import fields
from typing import Any

import jax
import jax.numpy as jnp
import numpy as np
from jaxtyping import Array, Float

from quietbus.dynamics.closed_loop import attitudes
from quietbus.dynamics.equations import moving, rates_of
from quietbus.dynamics.state import BodyState, State
from quietbus.model.cluster import Units
from quietbus.model.element import Own, Rates
from quietbus.model.satellite import BUS, CONTROL, Satellite
from quietbus.model.struts import SpringDamper
from quietbus.programs import compiled_for_few_runs
from quietbus.reference import units as reference_units
from quietbus.reference.body import Body
from quietbus.reference.mechanism import LegParts, Legs, Mechanism
from quietbus.reference.motion import Motion


def mechanism_of(satellite: Satellite) -> Mechanism:
    """A satellite's bodies and struts as the reference's, for satellites without a scenario.

    ``validate`` does not use it: there the reference reads the scenario for itself.
    """
    plain: Any = jax.tree.map(np.asarray, satellite)
    names = tuple(body.name for body in satellite.bodies)
    number = {name: i for i, name in enumerate(names)}
    one_with_bus = {BUS}
    for mount in satellite.mounts:
        if mount.welded:
            if mount.base not in one_with_bus:
                raise ValueError(
                    f"{mount.body} is welded to {mount.base}, which moves: the MuJoCo model knows "
                    "bodies that are free, or welded to the bus"
                )
            one_with_bus.add(mount.body)
    pose = satellite.nominal()
    return Mechanism(
        names=names,
        bodies=Body(
            np.stack([body.mass_X for body in plain.bodies]),
            np.stack([body.p_XXcm_X for body in plain.bodies]),
            np.stack([body.I_XXcm_X for body in plain.bodies]),
        ),
        p_BX_B=np.stack([pose[name].p for name in names]),
        R_BX=np.stack([pose[name].R_AX for name in names]),
        welded=np.array([name not in satellite.free for name in names]),
        legs=_joined([_legs(each, number) for each in plain.hexapods]),
        units=_joined([_units(each, number) for each in plain.clusters]),
    )


def _legs(hexapod: Any, number: dict[str, int]) -> Legs:
    upper, lower = (number[host] for host in hexapod.hosts)
    geometry, bodies, strut = hexapod.geometry, hexapod.bodies, hexapod.strut
    if not isinstance(hexapod.strut, SpringDamper):
        raise ValueError(f"{hexapod.name}: the MuJoCo model knows springs with dampers only")
    feet = len(strut.stiffness)
    return Legs(
        np.full(feet, lower),
        np.full(feet, upper),
        geometry.p_BA_B,
        geometry.p_PU_P,
        geometry.k_B,
        strut.stiffness,
        strut.damping,
        strut.free_length,
        _parts(bodies.lower),
        _parts(bodies.upper),
        bodies.spherical_friction,
        bodies.universal_friction,
    )


def _parts(parts: Any) -> LegParts:
    return LegParts(parts.mass, parts.distance, parts.transverse_inertia, parts.axial_inertia)


def _units(cluster: Any, number: dict[str, int]) -> reference_units.Units:
    units, count = cluster.units, cluster.count
    along_y = np.stack([0.0 * units.eccentricity, units.eccentricity], axis=1)
    held = cluster.gimbals.turning(*(np.zeros(cluster.cut),) * 3).angle
    return reference_units.Units(
        host=np.full(count, number[cluster.hosts[0]]),
        wheel=np.full(count, cluster.cut == 0),
        position_X=units.p_PC_P,
        axes_X=units.R_PG0 @ _about_z(np.asarray(held)),
        gimbal=Body(units.gimbal_mass, units.p_CGcm_G, units.I_GGcm_G),
        rotor=Body(units.rotor_mass, np.pad(along_y, ((0, 0), (0, 1))), units.I_RRcm_R),
        rotor_centre_G=units.p_CR_G,
        bearing_G=units.R_GF,
        speed=units.rotor_speed,
        phase=units.rotor_phase,
        gimbal_angle=np.zeros(count),
    )


def _about_z(angle: np.ndarray) -> np.ndarray:
    cos, sin, zero, one = np.cos(angle), np.sin(angle), 0.0 * angle, 1.0 + 0.0 * angle
    return np.stack([cos, -sin, zero, sin, cos, zero, zero, zero, one], axis=1).reshape(-1, 3, 3)


def _joined(several: list[Any]) -> Any:
    """The legs, units, or parts of them, of all groups as one."""
    if isinstance(several[0], np.ndarray):
        return np.concatenate(several)
    names = [field.name for field in fields(several[0])]
    return type(several[0])(*(_joined([getattr(one, name) for one in several]) for name in names))


def motion_of(satellite: Satellite, t: float | Float[Array, ""], state: State) -> Motion:
    """A state at time t [s], which turns rotors of prescribed speed, as the reference's motion."""
    found = _motion(satellite, jnp.asarray(t, float), state)
    return Motion(**{name: np.array(value) for name, value in found.items()})


@compiled_for_few_runs
def _motion(satellite: Satellite, t: Float[Array, ""], state: State) -> dict[str, Array]:
    motions = moving(satellite, t, state).motions
    bodies, turned = [motions[body.name] for body in satellite.bodies], attitudes(satellite, state)
    units = [cluster.at(t, state.own) for cluster in satellite.clusters]
    z = state.own[CONTROL].z
    return {
        "p_NX_N": jnp.stack([m.p for m in bodies]),
        "q_NX": jnp.stack([turned[body.name] for body in satellite.bodies]),
        "v_NX_N": jnp.stack([m.v for m in bodies]),
        "w_NX_X": jnp.stack([m.R_AX.T @ m.w for m in bodies]),
        "gimbal_angle": _all([each.gimbal.angle for each in units]),
        "gimbal_rate": _all([each.gimbal.rate for each in units]),
        "rotor_angle": _all([each.rotor.angle for each in units]),
        "rotor_speed": _all([each.rotor.rate for each in units]),
        "error_integral": z if len(z) else jnp.zeros(3),
    }


def driven_by(
    satellite: Satellite, t: Float[Array, ""], state: State, rates: dict[str, Rates]
) -> tuple[Float[Array, " cmg"], Float[Array, " cmg"]]:
    """Accelerations of all gimbals and of all rotors [rad/s^2] by what drives do."""
    units: list[Units] = []
    for cluster in satellite.clusters:
        own = state.own.get(cluster.name, cluster.start())
        units.append(cluster.turning(t, own, rates_of(rates, cluster).y))
    return (
        _all([each.gimbal.acceleration for each in units]),
        _all([each.rotor.acceleration for each in units]),
    )


def _all(parts: list[Array]) -> Array:
    return jnp.concatenate([jnp.zeros(0), *parts])


def state_of(satellite: Satellite, motion: Motion) -> State:
    """A motion as the satellite's state; what is prescribed is no part of it."""
    m = {name: jnp.asarray(value) for name, value in vars(motion).items()}
    bodies = {
        body.name: BodyState(*(m[name][i] for name in ("p_NX_N", "q_NX", "v_NX_N", "w_NX_X")))
        for i, body in enumerate(satellite.bodies)
        if body.name in satellite.free
    }
    own = satellite.start()
    for cluster, some in satellite.numbered():
        y, y_rate = (
            jnp.concatenate([of_gimbals[some][: cluster.cut], of_rotors[some]])[: cluster.driven]
            for of_gimbals, of_rotors in (
                (m["gimbal_angle"], m["rotor_angle"]),
                (m["gimbal_rate"], m["rotor_speed"]),
            )
        )
        if cluster.driven:
            own[cluster.name] = Own.of(y=y, y_rate=y_rate)
    own[CONTROL] = Own.of(z=m["error_integral"][: len(own[CONTROL].z)])
    return State(bodies, own)


def holding_legs(satellite: Satellite) -> np.ndarray:
    """(leg,) which legs hold their bodies; others are between bodies that are one."""
    each = [np.full(len(h.strut.free_length), h.holds) for h in satellite.hexapods]
    return np.concatenate([np.zeros(0, bool), *each])
