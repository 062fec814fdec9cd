"""Jitter of a scenario at one operating point (``quietbus jitter``)."""

from collections.abc import Sequence
from dataclasses import dataclass, replace
from functools import cached_property
from importlib.metadata import version
from typing import Any

import equinox as eqx
import jax
import jax.numpy as jnp
import numpy as np

from quietbus.analysis.jitter.combine import Combined, combine
from quietbus.analysis.jitter.lines import (
    AT_REST,
    KINDS,
    budget,
    for_designs,
    imbalance_kinds,
    rest_error,
    steady_jitter,
)
from quietbus.analysis.jitter.sweep import (
    SpeedSweep,
    SpinningModes,
    bearing_critical_speeds,
    bearing_modes,
    critical_speeds,
)
from quietbus.analysis.jitter.worst import SEARCHED, WorstAngles, worst_angles
from quietbus.arguments import choice, listing, positive
from quietbus.arguments import count as whole
from quietbus.build import build_satellite
from quietbus.dynamics.rotor_response import orders_of
from quietbus.dynamics.vibration import Vibration
from quietbus.model.moments import ORDERS
from quietbus.model.satellite import Satellite
from quietbus.model.variants import with_rotor_speed
from quietbus.plain import ARCSEC, json_ready
from quietbus.programs import compiled, compiled_for_few_runs
from quietbus.scenario import Scenario, ScenarioError
from quietbus.solve.noise import Broadband, noise_at, noisy
from quietbus.solve.validity import ResonanceError, refuse_resonance

MOUNTS = ("isolated", "rigid")
SWEPT = 1.2  # times the rotors' own speed: where a sweep ends unless told otherwise
# differences of the scenario's algebra: offsets in steps and weights
_CENTRAL: tuple[tuple[int, ...], np.ndarray] = (
    (-3, -2, -1, 1, 2, 3),
    np.array([-1, 9, -45, 45, -9, 1]) / 60.0,
)
_FORWARD: tuple[tuple[int, ...], np.ndarray] = (
    (0, 1, 2, 3, 4),
    np.array([-25, 48, -36, 16, -3]) / 12.0,
)


@dataclass(frozen=True)
class JitterStudy:
    """Jitter of the satellite at rest, at given gimbal angles, with the isolator and without.

    Parts are made when asked for. Amplitudes are complex, those of
    ``Re(amplitude exp(i h phi))`` at order h of a rotor at angle phi; axes are those of the bus.

    Raises:
        ValueError: the satellite cannot rest in the nominal pose (preloaded struts).
        ResonanceError: an order of a rotor lies on an undamped mode.
    """

    scenario: Scenario
    gimbal_angle: np.ndarray  # (cmg,) [rad]

    def __post_init__(self) -> None:
        for mount in MOUNTS:
            small = jax.tree.map(lambda leaf: leaf[0], self._at_rest[mount][1])
            error = rest_error(small)
            if error > AT_REST:
                raise ValueError(
                    "jitter is analysed at rest in the nominal pose, which is no equilibrium "
                    f"here: the {mount} satellite accelerates by {error:.3g} (SI). Take the "
                    "struts' preload away (isolator.legs.free_length), or use `quietbus simulate "
                    "--method harmonic`"
                )
            modes = np.linalg.eigvals(small.state_matrix())
            speeds = np.asarray(self.satellite(mount).rotor_speed)
            refuse_resonance(self.satellite(mount), f"with mount {mount}", modes, speeds)

    @property
    def held(self) -> bool:
        """Whether no gimbal turns, as with wheels: there are no angles to search then."""
        return not self.satellite("isolated").steered

    def satellite(self, mount: str) -> Satellite:
        """Parameters of the model."""
        return self._satellites[choice("mount", mount, MOUNTS)]

    @cached_property
    def _satellites(self) -> dict[str, Satellite]:
        return {mount: build_satellite(self.scenario, mount) for mount in MOUNTS}  # type: ignore[arg-type]

    @property
    def orders(self) -> tuple[float, ...]:
        """Multiples of rotor speed: of imbalance, and of the rotors' tables."""
        return orders_of(self.satellite("isolated"))

    @cached_property
    def frequency(self) -> np.ndarray:
        """(cmg, order) [rad/s]."""
        return np.outer(self.satellite("isolated").rotor_speed, self.orders)

    @cached_property
    def _at_rest(self) -> dict[str, tuple[dict[str, np.ndarray], Vibration]]:
        return {
            mount: _compute([self.satellite(mount)], self.gimbal_angle[None]) for mount in MOUNTS
        }

    @cached_property
    def outputs(self) -> dict[str, dict[str, np.ndarray]]:
        """Amplitudes (cmg, order, ...) by mount and output."""
        return {
            mount: {name: values[0] for name, values in outputs.items()}
            for mount, (outputs, _) in self._at_rest.items()
        }

    def bus_rate(self, mount: str) -> np.ndarray:
        """Amplitudes (cmg, order, axis) [rad/s]."""
        return self.outputs[choice("mount", mount, MOUNTS)]["bus_rate"]

    def worst_phases(self, mount: str, gimbal_angle: np.ndarray | None = None) -> np.ndarray:
        """(axis,) bus rate [rad/s] with the worst rotor phases: the sum of all amplitudes.

        Args:
            gimbal_angle: (cmg,) [rad] instead of the study's own.
        """
        amplitude = self.bus_rate(mount)
        if gimbal_angle is not None:
            amplitude = jitter_of_designs([self.satellite(mount)], gimbal_angle)["bus_rate"][0]
        return np.sum(np.abs(amplitude), axis=(0, 1))

    def combined(self, mount: str, output: str = "bus_rate") -> Combined:
        """All rotors and orders together, in the output's unit."""
        outputs = self.outputs[choice("mount", mount, MOUNTS)]
        values = outputs[choice("output", output, list(outputs))]
        phase = np.outer(self.satellite(mount).rotor_phase, self.orders)
        combined = combine(values, self.frequency, phase)
        noise = self.noise(mount)
        return combined if noise is None else combined.with_noise(noise.variance(output, 1)[0])

    def noise(self, mount: str) -> Broadband | None:
        """Spectra of the answer to the rotors' broadband disturbance; None if there is none.

        Their ``psd`` has a leading axis of one instant, then frequencies and rotors.
        """
        return self._noise[choice("mount", mount, MOUNTS)]

    @cached_property
    def _noise(self) -> dict[str, Broadband | None]:
        found: dict[str, Broadband | None] = {}
        for mount in MOUNTS:
            satellite, small = self.satellite(mount), self._at_rest[mount][1]
            found[mount] = None
            if noisy(satellite):
                small = jax.tree.map(lambda leaf: leaf[0], small)
                found[mount] = noise_at(satellite, small)
        return found

    @property
    def imbalance_orders(self) -> tuple[int, ...]:
        """Multiples of rotor speed that imbalance causes."""
        return ORDERS

    @property
    def kinds(self) -> tuple[str, ...]:
        """What the budget tells apart."""
        tables = (c.disturbance.tables() for c in self.satellite("isolated").clusters)
        return KINDS if any(np.any(table) for table in tables) else KINDS[:-1]

    @cached_property
    def budget(self) -> dict[str, np.ndarray]:
        """Parts of the bus rate's amplitudes (kind, cmg, order, axis) [rad/s] by mount."""
        parts = {}
        for mount in MOUNTS:
            variants = imbalance_kinds(self.satellite(mount))
            values = jitter_of_designs(variants, self.gimbal_angle)["bus_rate"]
            parts[mount] = budget(self.bus_rate(mount), *values)[: len(self.kinds)]
        return parts

    def worst(self, mount: str) -> WorstAngles:
        """Gimbal angles with the largest ``worst_case_norm`` of the bus rate [rad/s]."""
        same, turning = [self.satellite(mount)] * SEARCHED, list(self.satellite(mount).steered)

        def measure(sought: np.ndarray) -> np.ndarray:
            angles = np.tile(self.gimbal_angle, (SEARCHED, 1))
            angles[:, turning] = sought
            return worst_case_norm(jitter_of_designs(same, angles)["bus_rate"])

        found = worst_angles(measure, len(turning))
        angle = self.gimbal_angle.copy()
        angle[turning] = found.gimbal_angle
        return replace(found, gimbal_angle=angle)

    def sweep(self, max_speed: float | None = None, count: int = 256) -> SpeedSweep:
        """Jitter and modes as the speed of all rotors rises together from rest.

        Args:
            max_speed: [rad/s] of the fastest rotor; by default 1.2 times its own.
            count: of the speeds, close to each other near rest; the rotors' own and the critical
                speeds are added.

        Raises:
            ValueError: no rotor turns, or the speed is not positive.
        """
        count = whole("count", count, least=2)
        if max_speed is not None:
            positive("max_speed", max_speed)
        own = np.asarray(self.satellite("isolated").rotor_speed)
        fastest = float(np.max(np.abs(own)))
        if fastest == 0.0:
            raise ValueError("a sweep of the rotors' speed needs one that turns")
        most = SWEPT if max_speed is None else max_speed / fastest
        factor = np.append(np.geomspace(1e-3, 1.0, count // 2), np.linspace(0, 1, count // 2 + 1))
        factor = np.unique(np.append(most * factor, 1.0 if most >= 1.0 else most))
        modes, critical = {}, {}
        for mount in MOUNTS:
            ends = np.array([0.0, 0.5 * most, most])
            modes[mount] = SpinningModes.between(self._at_speeds(mount, ends)[1], ends)
            critical[mount] = critical_speeds(modes[mount], own, self.orders, most)
        own_rotors = self.satellite("isolated")
        inner = bearing_critical_speeds(own_rotors, self.orders, most)
        crossed = [found.factor for each in (*critical.values(), inner) for found in each]
        factor = np.unique(np.append(factor, crossed))
        bus_rate = {}
        for mount in MOUNTS:
            rate = self._at_speeds(mount, factor)[0]["bus_rate"]
            rate[factor == 0.0] = 0.0  # steering by standing rotors has no meaning
            bus_rate[mount] = rate
        phase = np.asarray(self.satellite("isolated").rotor_phase)
        return SpeedSweep(
            factor,
            own,
            phase,
            self.orders,
            bus_rate,
            modes,
            critical,
            bearing_modes(own_rotors),
            inner,
            () if self.held else tuple(self.gimbal_angle),
        )

    def _at_speeds(
        self, mount: str, factors: np.ndarray
    ) -> tuple[dict[str, np.ndarray], Vibration]:
        own = self.satellite(mount)
        speed = np.asarray(own.rotor_speed)
        designs = [with_rotor_speed(own, factor * speed) for factor in factors]
        return _compute(
            designs, np.broadcast_to(self.gimbal_angle, (len(designs), len(self.gimbal_angle)))
        )

    def derivative(
        self, paths: Sequence[str], mount: str, output: str = "bus_rate"
    ) -> dict[str, np.ndarray]:
        """Derivatives of the amplitudes (cmg, order, ...) by scenario parameters, in SI units.

        The physics is differentiated automatically (JAX). How the model's parameters follow from
        the scenario's is algebra in NumPy; its derivative along one parameter is a difference of
        sixth order, exact to about 1e-12.

        Args:
            paths: dotted, as of ``Scenario.with_overrides``, of single numbers:
                ``"isolator.legs.stiffness"``, ``"cluster.rotor.speed"``.

        Raises:
            ScenarioError: the scenario has no such path, or what lies there is not one number.
        """
        paths = listing("paths", paths, "dotted paths of a scenario's numbers")
        satellite = self.satellite(mount)
        choice("output", output, list(self.outputs[mount]))
        ways = [self._way(path, mount) for path in paths]
        stacked = jax.tree.map(lambda *each: jnp.stack(each), *ways)
        values = _compiled_derivative(satellite, stacked, self.gimbal_angle, output)
        return dict(zip(paths, np.asarray(values), strict=True))

    def _way(self, path: str, mount: str) -> Satellite:
        """Derivative of the satellite's parameters by a scenario parameter."""
        value = self.scenario.number(path)
        step = 1e-3 * (abs(value) or 1.0)

        def parameters(offset: int) -> Any:
            changed = self.scenario.with_overrides({path: value + offset * step})
            satellite = build_satellite(changed, mount)  # type: ignore[arg-type]
            return jax.tree.map(np.asarray, eqx.filter(satellite, eqx.is_array))

        try:
            offsets, weights = _CENTRAL
            built = [parameters(offset) for offset in offsets]
        except ScenarioError:  # at the end of what the scenario allows, zero say
            offsets, weights = _FORWARD
            built = [parameters(offset) for offset in offsets]
        # where there is no limit it is infinite, and stays so
        finite = [jax.tree.map(lambda leaf: np.where(np.isinf(leaf), 0.0, leaf), b) for b in built]
        return jax.tree.map(
            lambda *each: sum(w * leaf for w, leaf in zip(weights, each, strict=True)) / step,
            *finite,
        )

    def to_dict(self, max_speed: float | None = None) -> dict[str, Any]:
        """For JSON, with the keys of the interface; see docs/jitter.md.

        Args:
            max_speed: where the sweep ends, as of ``sweep``; there is none if no rotor turns.
        """
        own = self.scenario.mount
        size = {mount: np.abs(self.bus_rate(mount)) for mount in MOUNTS}
        turn = {mount: np.abs(self.outputs[mount]["bus_attitude"]) for mount in MOUNTS}
        orders = [
            {
                "cmg": j,
                "order": h,
                "frequency_hz": abs(self.frequency[j, k]) / (2.0 * np.pi),
                "bus_rate_amplitude_deg_s": np.rad2deg(size[own][j, k]),
                **{
                    mount: {
                        "bus_rate_amplitude_deg_s": np.rad2deg(size[mount][j, k]),
                        "bus_attitude_amplitude_arcsec": ARCSEC * turn[mount][j, k],
                    }
                    for mount in MOUNTS
                },
                **ratio(size["isolated"][j, k], size["rigid"][j, k]),
            }
            for j in range(len(self.gimbal_angle))
            for k, h in enumerate(self.orders)
        ]
        together = {mount: self._combined_dict(mount) for mount in MOUNTS}
        envelope = {mount: self.combined(mount).envelope for mount in MOUNTS}
        worst = {}
        for mount in () if self.held else MOUNTS:
            found = self.worst(mount)
            worst[mount] = {
                "gimbal_angle_deg": np.rad2deg(found.gimbal_angle),
                "bus_rate_norm_deg_s": np.rad2deg(found.value),
                "bus_rate_norm_here_deg_s": np.rad2deg(
                    worst_case_norm(self.bus_rate(mount)[None])[0]
                ),
                "evaluations": found.evaluations,
            }
        return json_ready(
            {
                "scenario": self.scenario.name,
                "version": version("quietbus"),
                "mount": own,
                "gimbal_angle_deg": np.rad2deg(self.gimbal_angle),
                "axes": ["x", "y", "z"],
                "orders": orders,
                "combined": together | ratio(envelope["isolated"], envelope["rigid"]),
                "budget": {
                    mount: [
                        {
                            "cmg": j,
                            "kind": kind,
                            "order": h,
                            "bus_rate_amplitude_deg_s": np.rad2deg(np.abs(part[i, j, k])),
                        }
                        for i, kind in enumerate(self.kinds)
                        for j in range(len(self.gimbal_angle))
                        for k, h in enumerate(self.orders)
                    ]
                    for mount, part in self.budget.items()
                },
                "worst": worst,
                "sweep": self.sweep(max_speed).to_dict() if np.any(self.frequency) else None,
            }
        )

    def _combined_dict(self, mount: str) -> dict[str, Any]:
        rate, turn = self.combined(mount), self.combined(mount, "bus_attitude")
        kinds = ("envelope", "worst_case", "rss", "rms")
        noise = self.noise(mount)
        rms = {
            output: np.sqrt(noise.variance(output, 1)[0]) if noise else np.zeros(3)
            for output in ("bus_rate", "bus_attitude")
        }
        return {
            "bus_rate_noise_rms_deg_s": np.rad2deg(rms["bus_rate"]),
            "bus_attitude_noise_rms_arcsec": ARCSEC * rms["bus_attitude"],
            **{f"bus_rate_{kind}_deg_s": np.rad2deg(getattr(rate, kind)) for kind in kinds},
            **{f"bus_attitude_{kind}_arcsec": ARCSEC * getattr(turn, kind) for kind in kinds},
        }


def worst_case_norm(amplitude: np.ndarray) -> np.ndarray:
    """Norm over the axes of the sum of all amplitudes, for amplitudes (n, cmg, order, axis)."""
    return np.linalg.norm(np.sum(np.abs(amplitude), axis=(1, 2)), axis=-1)


def worst_over_phases(
    scenario: Scenario,
    gimbal_angle: np.ndarray,
    rotor_speed: np.ndarray,
) -> np.ndarray | None:
    """(3,) bus rate [rad/s] with the worst rotor phases: the sum of all lines' amplitudes.

    At rest, as of ``JitterStudy``; None where there is no such steady motion.

    Args:
        gimbal_angle: (cmg,) [rad].
        rotor_speed: (cmg,) [rad/s].
    """
    satellite = with_rotor_speed(build_satellite(scenario), jnp.asarray(rotor_speed))
    outputs, small = _compute([satellite], gimbal_angle[None])
    small = jax.tree.map(lambda leaf: leaf[0], small)
    if rest_error(small) > AT_REST:
        return None
    try:
        modes = np.linalg.eigvals(small.state_matrix())
        refuse_resonance(satellite, "", modes, np.asarray(satellite.rotor_speed))
    except ResonanceError:
        return None
    return np.sum(np.abs(outputs["bus_rate"][0]), axis=(0, 1))


def ratio(isolated: np.ndarray, rigid: np.ndarray) -> dict[str, list[float | None]]:
    """What the isolator leaves, per axis, in percent and dB; None where there is nothing."""
    parts = [i / r if r > 0.0 else None for i, r in zip(isolated, rigid, strict=True)]
    return {
        "ratio_percent": [None if part is None else 100.0 * part for part in parts],
        "ratio_db": [20.0 * float(np.log10(part)) if part else None for part in parts],
    }


def jitter_of_designs(
    designs: Sequence[Satellite], gimbal_angle: np.ndarray
) -> dict[str, np.ndarray]:
    """Amplitudes (design, cmg, order, ...) by output, of satellites alike but for their numbers.

    Args:
        designs: of the same mount, number of legs and CMGs, control and steering law.
        gimbal_angle: (cmg,) [rad], or (design, cmg) for each its own.
    """
    return _compute(
        designs, np.broadcast_to(gimbal_angle, (len(designs), *gimbal_angle.shape[-1:]))
    )[0]


def _compute(
    designs: Sequence[Satellite], angles: np.ndarray
) -> tuple[dict[str, np.ndarray], Vibration]:
    """Amplitudes and the equations that they solve, in one program for any number of designs."""
    return for_designs(_compiled_designs, designs, angles)


@compiled
def _compiled_designs(satellites, angles):
    return eqx.filter_vmap(steady_jitter)(satellites, jnp.asarray(angles))


@compiled_for_few_runs
def _compiled_derivative(satellite, ways, gimbal_angle, output):
    arrays, rest = eqx.partition(satellite, eqx.is_array)

    def amplitude(arrays):
        satellite = eqx.combine(arrays, rest)
        return steady_jitter(satellite, jnp.asarray(gimbal_angle))[0][output]

    _, push = jax.linearize(amplitude, arrays)
    return jax.vmap(push)(ways)
