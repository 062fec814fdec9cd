"""From one platform under the whole cluster to a platform of its own under every CMG."""

from __future__ import annotations

from typing import Any

import numpy as np

from quietbus.arguments import positive
from quietbus.scenario.disturbance import Disturbance
from quietbus.scenario.errors import Problem, ScenarioError
from quietbus.scenario.schema import Scenario
from quietbus.words import shown


def per_cmg_scenarios(scenario: Scenario, scale: float | None = None) -> list[Scenario]:
    """One scenario for each CMG: the same bus with that CMG alone, on a platform of its own.

    The budget of plate, struts and joints is shared out: each of the n platforms has a copy of the
    legs with 1/n of the stiffness, damping, friction and mass, and 1/n of the plate's mass. Its
    geometry is the scenario's times ``scale``; moments of inertia go with mass times length
    squared. So stiffness, damping and mass of all platforms together are those of the one, and
    frequencies and damping ratios in translation are too. The upper plate's centre is where the
    CMG stood, so CMGs and lever arms stay; the base plates come nearer by the shorter separation.
    Plates stay parallel. Random phases are those that the one platform has, as numbers, and the
    rotors' noise has seeds of its own: as files, the scenarios know nothing of each other.

    What comes out are usual scenarios: write them to files, change them, give them to
    ``quietbus.platforms``. External loads are left out.

    Args:
        scenario: with any number n of CMGs.
        scale: of lengths [-]; by default 1/sqrt(n), so that the n base plates cover the area of
            the one.

    Raises:
        ValueError: a scale that is not above zero.
        ScenarioError: the steering law is the pseudo-inverse, which no CMG alone can follow; or
            the units are reaction wheels.
    """
    if not isinstance(scenario, Scenario):
        raise TypeError(f"scenario: expected a Scenario, got {shown(scenario)}")
    if not np.all(scenario.units.turning):
        said = "expected cmg for platforms that stand one under each CMG, got wheel"
        raise ScenarioError(scenario.name, [Problem(said, ("cluster", "type"))])
    if len(scenario.sites) > 1 or len(scenario.units.blocks) > 1:
        said = "expected one platform with one block of CMGs, got several"
        raise ScenarioError(scenario.name, [Problem(said, ("platforms",))])
    from scipy.spatial.transform import Rotation  # takes as long to load as all else here

    data, n = scenario.to_dict(), scenario.units.count
    scale = n**-0.5 if scale is None else scale
    positive("scale", scale)
    share = 1.0 / n
    isolator = data["isolator"]
    base = Rotation.from_euler("ZYX", isolator.get("orientation", [0.0, 0.0, 0.0])[::-1])
    separation = scale * isolator["separation"]
    legs = _times(isolator["legs"], _BY_LEG, share, scale)
    plate = _times(isolator["plate"], _BY_PLATE, share, scale)
    phases = scenario.units.phases()
    angles = data["cluster"].get("gimbal_angles", [0.0] * n)
    found = []
    for j, unit in enumerate(scenario.units.placed()):
        height = [0.0, 0.0, isolator["separation"] - separation]
        offset = isolator["offset"] + base.apply(np.add(unit.position, height))
        cluster = {k: v for k, v in data["cluster"].items() if k not in ("pyramid", "units")}
        place: dict[str, Any] = unit.model_dump(mode="json", exclude_none=True)
        if unit.rotor and unit.rotor.disturbance:
            place["rotor"]["disturbance"] |= _drawn(unit.rotor.disturbance, j)
        cluster |= {
            "units": [
                {k: place[k] for k in ("gimbal_axis", "spin_axis")} | {"position": [0, 0, 0]}
            ],
            "gimbal_body": place["gimbal_body"],
            "rotor": place["rotor"],
            "rotor_phases": [phases[j]],
            "gimbal_angles": [angles[j]],
        }
        motor = scenario.units.blocks[0].gimbal_motor
        if motor is not None:
            seed = scenario.units.seeds[j]
            cluster["gimbal_motor"] = _drawn_motor(cluster["gimbal_motor"], *motor.phases(seed, j))
        if "run_up" in cluster:
            each = {k: v[j] for k, v in cluster["run_up"].items() if isinstance(v, list)}
            cluster["run_up"] = cluster["run_up"] | each
        own = isolator | {
            "offset": offset.tolist(),
            "separation": separation,
            "plate": plate,
            "legs": legs,
        }
        name = f"{scenario.name}-cmg{j}"
        changed = {"name": name, "isolator": own, "cluster": cluster, "loads": []}
        found.append(Scenario.from_dict(data | changed, name))
    return found


def _drawn(disturbance: Disturbance, unit: int) -> dict[str, Any]:
    """What was random of a rotor: phases as numbers, and a seed that no other rotor has."""
    seed = np.random.SeedSequence([disturbance.seed, unit]).generate_state(1)[0]
    if disturbance.orders is None:
        return {"seed": int(seed)}
    orders = [
        line.model_dump(mode="json", exclude_none=True) | {"phase": phase}
        for line, phase in zip(disturbance.orders, disturbance.phases(unit), strict=True)
    ]
    return {"seed": int(seed), "orders": orders}


def _drawn_motor(data: dict[str, Any], ripple: tuple[float, ...], steps: float) -> dict[str, Any]:
    """A gimbal motor with its phases as numbers."""
    lines = zip(data.get("ripple", []), ripple, strict=True)
    drawn: dict[str, Any] = {"ripple": [line | {"phase": phase} for line, phase in lines]}
    if "stepping" in data:
        drawn["stepping"] = data["stepping"] | {"phase": steps}
    return data | {key: value for key, value in drawn.items() if value}


_BY_PLATE = {"mass": (1, 0), "inertia": (1, 2), "center_of_mass": (0, 1)}
_BY_PART = {
    "mass": (1, 0),
    "distance": (0, 1),
    "transverse_inertia": (1, 2),
    "axial_inertia": (1, 2),
}
_BY_LEG: dict[str, Any] = {
    "upper_joints": (0, 1),
    "lower_joints": (0, 1),
    "universal_axes": (0, 0),
    "stiffness": (1, 0),
    "damping": (1, 0),
    "free_length": (0, 1),
    "spherical_friction": (1, 0),
    "universal_friction": (1, 0),
    "upper_part": _BY_PART,
    "lower_part": _BY_PART,
}


def _times(data: dict[str, Any], powers: dict[str, Any], share: float, scale: float) -> Any:
    """Each entry times powers of the share and of the scale, given by key for every key."""

    def scaled(value: Any, power: Any) -> Any:
        if isinstance(power, dict):
            each = lambda part: _times(part, power, share, scale)  # noqa: E731
            return [each(part) for part in value] if isinstance(value, list) else each(value)
        factor = share ** power[0] * scale ** power[1]
        return (np.asarray(value, float) * factor).tolist()

    return {key: scaled(value, powers[key]) for key, value in data.items()}
