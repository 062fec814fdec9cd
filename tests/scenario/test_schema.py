# ruff: noqa: E501 (a mistake and its message on one line)
"""What a scenario may say; every refusal with its file, line, field and expectation."""

import copy
import operator
import pickle
import re

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from quietbus.scenario import LineOfSight, Scenario, ScenarioError, builtin_text, load_scenario
from quietbus.scenario.base import name_defect
from quietbus.scenario.checks import free_directions, inertia_defect

TEXT = builtin_text("zhang2012")
ZHANG = load_scenario("zhang2012")
DATA = ZHANG.to_dict()
CUBIC_LOWER, CUBIC_UPPER = (np.array(joints) for joints in ZHANG.isolator.joints())


def refusal(text: str) -> str:
    with pytest.raises(ScenarioError) as error:
        Scenario.from_yaml(text, "s.yaml")
    return str(error.value)


def changed(**parts: object) -> Scenario:
    """The built-in with whole parts replaced: ``changed(cluster__rotor={...})``."""
    data = copy.deepcopy(DATA)
    for path, value in parts.items():
        *above, last = path.split("__")
        place = data
        for key in above:
            place = place[key]
        place[last] = value
    return Scenario.from_dict(data, "s")


def problem(**parts: object) -> str:
    with pytest.raises(ScenarioError) as error:
        changed(**parts)
    return str(error.value)


# ---- text with one mistake: message, with the line of the mistake

MISTAKES = [
    # wrong dimensions
    ("damping: 500 N*s/m", "damping: 500 N/m", "isolator.legs.damping (line {}): expected a damping in N*s/m, got '500 N/m' (a stiffness?)"),
    ("stiffness: 20 kN/m", "stiffness: [20 kN/m, 1 N, 1, 1, 1, 1]", "isolator.legs.stiffness[1] (line {}): expected a stiffness in N/m, got '1 N' (a force?)"),
    ("speed: 6000 rpm", "speed: 100 Hz", "cluster.rotor.speed (line {}): expected an angular velocity in rad/s, got '100 Hz' (turns or radians? write rpm, rev/s, deg/s or rad/s)"),
    ("output_rate: 1 kHz", "output_rate: 6000 rpm", "simulation.output_rate (line {}): expected a frequency in Hz, got '6000 rpm' (an angular velocity? frequencies are in Hz)"),
    ("offset: [0, 0, 0.6]", "offset: [0, 0, 0.6 kg]", "isolator.offset[2] (line {}): expected a length in m, got '0.6 kg' (a mass?)"),
    ("attitude: [1.5 deg, 1.5 deg", "attitude: [1.5 deg, 1.5 deg/s", "initial.attitude[1] (line {}): expected an angle in rad, got '1.5 deg/s' (an angular velocity?)"),
    ("momentum: 15 N*m*s", "momentum: 15 N*m", "cluster.rotor.momentum (line {}): expected an angular momentum in N*m*s, got '15 N*m' (a torque?)"),
    # unknown keys
    ("mount: isolated", "mounts: isolated", "isolator.mounts (line {}): unknown key 'mounts'; did you mean 'mount'?"),
    ("skew: 53.13 deg", "skew: 53.13 deg, foo: 1", "cluster.pyramid.foo (line {}): unknown key 'foo'; known here: skew, radius, height, units"),
    ("law: singularity_robust", "law: pseudo_inverse, mu: 10", "control.steering.mu (line {}): unknown key 'mu'; known here: law"),
    ("law: singularity_robust", "law: singularity_robust, epsilon0: 1", "control.steering.epsilon0 (line {}): unknown key 'epsilon0'; known here: law, lambda0, mu"),
    ("kd: 2500}", "kd: 2500, gain: 3}", "control.pid.kp (line {}): unknown key 'kp'; known here: gain, zeros"),
    # missing values
    ("stiffness: 20 kN/m", "stiffness:", "isolator.legs.stiffness (line {}): expected a stiffness in N/m, or a strut; got nothing"),
    ("{mass: 0.25 kg, distance: 0.15 m,", "{mass: 0.25 kg,", "isolator.legs.upper_part.distance (line {}): expected a length in m, got nothing"),
    ("ki: 0.1,", "", "control.pid.ki (line {}): expected an integral gain in N*m/(rad*s), got nothing"),
    # no numbers
    ("offset: [0, 0, 0.6]", "offset: [0, .nan, 0.6]", "isolator.offset[1] (line {}): expected a length in m, got nan (not a finite number)"),
    ("duration: 100 s", "duration: .inf", "simulation.duration (line {}): expected a time in s, got inf (not a finite number)"),
    ("duration: 100 s", "duration: yes", "simulation.duration (line {}): expected a time in s, got 'yes'"),
    ("duration: 100 s", "duration: true", "simulation.duration (line {}): expected a time in s, got true"),
    ("duration: 100 s", "duration: 0 s", "simulation.duration (line {}): expected a time in s, got '0 s' (must be above 0)"),
    # shapes and words
    ("offset: [0, 0, 0.6]", "offset: [0, 0.6]", "isolator.offset (line {}): expected a list of 3 numbers, got [0, 0.6] (2 of them)"),
    ("offset: [0, 0, 0.6]", "offset: 0.6", "isolator.offset (line {}): expected a list of 3 numbers, got 0.6"),
    ("mount: isolated", "mount: ridgid", "isolator.mount (line {}): expected 'isolated' or 'rigid', got 'ridgid'"),
    ("law: singularity_robust", "law: pseudoinverse", "control.steering.law (line {}): expected one of singularity_robust, generalized_singularity_robust, pseudo_inverse, none, got 'pseudoinverse'"),
    ("guidance: step", "guidance: smooth", "target.guidance (line {}): expected step or a mapping with max_rate, max_acceleration, max_jerk, got 'smooth'"),
    ("name: zhang2012", "name: 2012", "name (line {}): expected a name of 1 to 100 printable letters, got 2012"),
    ("rotor_phases: [0, 0.7, 1.4, 2.1]", "rotor_phases: [0, 0.7]", "cluster.rotor_phases (line {}): expected 4 angles, one for each CMG, got 2"),
    ("stiffness: 20 kN/m", "stiffness: [1, 2]", "isolator.legs.stiffness (line {}): expected 6 entries, one for each of upper_joints, got 2"),
    ("height: 0 m}", "height: 0 m, units: 2.5}", "cluster.pyramid.units (line {}): expected a count of at least 1, got 2.5"),
    # impossible bodies
    ("{mass: 0.25 kg, distance", "{mass: -0.25 kg, distance", "isolator.legs.upper_part.mass (line {}): expected a mass in kg, got '-0.25 kg' (must be at least 0)"),
    ("axial_inertia: 1.0e-4}", "axial_inertia: 1}", "isolator.legs.upper_part.axial_inertia (line {}): expected at most twice the transverse inertia, as every body has it, got 1 kg*m^2"),
    ("inertia: [0.06, 0.06, 0.06]", "inertia: [0.06, 0.06, 0.13]", "cluster.gimbal_body.inertia (line {}): expected the principal inertia of a rigid body, but its principal moments 0.06, 0.06, 0.13 kg m^2 break the triangle inequality"),
    ("transverse_inertia: 0.0143239448782706", "transverse_inertia: 0.0119", "cluster.rotor.transverse_inertia (line {}): expected, with the spin inertia 0.0238732 kg*m^2"),
    ("dynamic_imbalance: 17 g*cm^2", "dynamic_imbalance: 17", "cluster.rotor.dynamic_imbalance (line {}): expected, with the spin inertia 0.0238732 kg*m^2, the transverse inertia 0.0143239 kg*m^2 and the dynamic imbalance 17 kg*m^2 (1.7e+08 g*cm^2), the inertia of a rigid body"),
    # rotors
    ("momentum: 15 N*m*s", "momentum: -15 N*m*s", "cluster.rotor.momentum (line {}): expected a momentum with the sign of the speed (628.319 rad/s), got -15 N*m*s"),
    ("speed: 6000 rpm", "speed: 0", "cluster.rotor.speed (line {}): expected a speed other than 0: a rotor at rest is described by spin_inertia instead of momentum"),
    # axes
    ("- [0, -1, 0]", "- [0, -1.01, 0]", "isolator.legs.universal_axes[1] (line {}): expected a unit vector, got [0.0, -1.01, 0.0] (its length is 1.01; normalised: [0, -1, 0])"),
    ("- [0, -1, 0]", "- [0, 0, 0]", "isolator.legs.universal_axes[1] (line {}): expected a unit vector, got [0.0, 0.0, 0.0] (its length is zero)"),
]  # fmt: skip


@pytest.mark.parametrize(("right", "wrong", "message"), MISTAKES)
def test_mistake_is_told_with_file_line_and_field(right, wrong, message):
    line = 1 + TEXT[: TEXT.index(right)].count("\n")
    told = refusal(TEXT.replace(right, wrong, 1)).splitlines()
    assert any(each.startswith("s.yaml: " + message.format(line)) for each in told), told


@pytest.mark.parametrize(
    ("right", "wrong", "path"),
    [
        ("bus:  ", "Bus:  ", "Bus"),
        ("bus:  ", "BUS:  ", "BUS"),
        ("stiffness: 20 kN/m", "stifness: 20 kN/m", "isolator.legs.stifness"),
        ("skew:", "skev:", "cluster.pyramid.skev"),
    ],
)
def test_misspelt_key_is_told_once(right, wrong, path):
    told = refusal(TEXT.replace(right, wrong, 1)).splitlines()
    assert len(told) == 1, told
    assert re.match(rf"s\.yaml: {path} \(line \d+\): unknown key '\w+'; did you mean", told[0])


def test_missing_key_beside_a_misspelt_one_is_told_too():
    told = refusal(
        TEXT.replace("stiffness: 20 kN/m", "stifness: 20 kN/m").replace(
            "    damping: 500 N*s/m", ""
        )
    )
    assert "isolator.legs.damping (line" in told
    assert len(told.splitlines()) == 2


@pytest.mark.parametrize("part", ["name", "bus", "isolator", "cluster"])
def test_part_that_a_scenario_must_have(part):
    data = {key: value for key, value in DATA.items() if key != part}
    with pytest.raises(ScenarioError, match=rf"^s: {part}: expected .*, got nothing$"):
        Scenario.from_dict(data, "s")


def test_small_scenario_has_sensible_defaults():
    data = {key: DATA[key] for key in ("name", "bus", "isolator", "cluster")}
    scenario = Scenario.from_dict(data)
    assert scenario.control is None
    assert scenario.loads == ()
    assert scenario.initial.attitude == scenario.initial.rate == (0.0, 0.0, 0.0)
    assert scenario.target.guidance == "step"
    assert (scenario.simulation.duration, scenario.simulation.output_rate) == (100.0, 1000.0)
    assert scenario.simulation.tolerances.relative == 1e-8
    assert scenario.simulation.tolerances.absolute == 1e-10
    assert Scenario.from_yaml(scenario.to_yaml()) == scenario


def test_values_do_not_change():
    scenario = Scenario.from_dict(DATA | {"lines_of_sight": {"x": {"direction": [0, 0, 1]}}})
    lines, line = scenario.lines_of_sight, LineOfSight(direction=(0, 1, 0))
    attempts = (
        lambda: setattr(scenario.bus, "mass", 3.0),
        lambda: delattr(scenario, "bus"),
        lambda: operator.setitem(lines, "x", line),
        lambda: operator.ior(lines, {"y": line}),
        lambda: lines.update(y=line),
        lambda: lines.pop("x"),
        lambda: scenario.isolator.legs.upper_joints.__setitem__(0, 1),
    )
    for attempt in attempts:
        with pytest.raises((TypeError, AttributeError), match=r"do not change|__setitem__"):
            attempt()
    assert scenario == Scenario.from_dict(scenario.to_dict())


@pytest.mark.parametrize("copied", [copy.deepcopy, lambda s: pickle.loads(pickle.dumps(s))])
def test_copies_are_equal_and_do_not_change_either(copied):
    scenario = Scenario.from_dict(DATA | {"lines_of_sight": {"x": {"direction": [0, 0, 1]}}})
    other = copied(scenario)
    assert other == scenario
    with pytest.raises(TypeError, match="do not change"):
        del other.lines_of_sight["x"]


# ---- inertia


@pytest.mark.parametrize("field", ["bus__inertia", "isolator__plate__inertia"])
@pytest.mark.parametrize(
    ("inertia", "why"),
    [
        ([[1, 0, 0], [0, 1, 0], [0, 0, 2.001]], "break the triangle inequality"),
        ([[1, 2, 0], [2, 1, 0], [0, 0, 1]], "it is not positive definite"),
        ([[0, 0, 0], [0, 1, 0], [0, 0, 1]], "it is not positive definite"),
        ([[1, 0.1, 0], [0, 1, 0], [0, 0, 1]], "it is not symmetric"),
    ],
)
def test_impossible_inertia(field, inertia, why):
    message = problem(**{field: inertia})
    path = field.replace("__", ".")
    assert f"s: {path}: expected the inertia matrix of a rigid body in kg*m^2, but" in message
    assert why in message


@given(
    st.lists(st.tuples(*[st.floats(-2, 2)] * 3), min_size=5, max_size=9),
    st.floats(1e-3, 1e3),
)
def test_cloud_of_points_is_a_possible_body(points, mass):
    """Oracle: the definition of inertia, for any distribution that fills space a little."""
    r = np.vstack([points, 0.1 * np.eye(3), -0.1 * np.eye(3)])
    inertia = mass * sum((p @ p) * np.eye(3) - np.outer(p, p) for p in r)
    assert inertia_defect(inertia) is None
    values, axes = np.linalg.eigh(inertia)
    values[2] = 1.001 * (values[0] + values[1])
    assert "triangle" in (inertia_defect(axes @ np.diag(values) @ axes.T) or "")


def test_thin_disc_with_imbalance_is_a_possible_rotor():
    spin = 15.0 / 628.3185307179587
    rotor = DATA["cluster"]["rotor"] | {"transverse_inertia": spin / 2.0}
    assert changed(cluster__rotor=rotor).cluster.rotor.dynamic_imbalance > 0.0


def test_rotor_inertia_has_minus_the_products():
    rotor = DATA["cluster"]["rotor"] | {
        "dynamic_imbalance": 1e-3,
        "dynamic_imbalance_phase": "30 deg",
    }
    inertia = changed(cluster__rotor=rotor).cluster.rotor.inertia
    assert inertia[0, 0] == pytest.approx(15.0 / (200.0 * np.pi), rel=1e-14)
    assert inertia[0, 1] == inertia[1, 0] == pytest.approx(-1e-3 * np.sqrt(0.75))
    assert inertia[0, 2] == inertia[2, 0] == pytest.approx(-0.5e-3)
    assert inertia[1, 1] == inertia[2, 2] == 0.0143239448782706
    assert inertia[1, 2] == inertia[2, 1] == 0.0


def test_rotor_says_momentum_or_spin_inertia():
    rotor = dict(DATA["cluster"]["rotor"])
    message = "cluster.rotor: expected exactly one of momentum and spin_inertia, got "
    assert message + "both" in problem(cluster__rotor=rotor | {"spin_inertia": 0.02})
    del rotor["momentum"]
    assert message + "neither" in problem(cluster__rotor=rotor)
    at_rest = rotor | {"spin_inertia": 0.02, "speed": 0}
    assert changed(cluster__rotor=at_rest).cluster.rotor.inertia[0, 0] == 0.02
    backwards = rotor | {"momentum": -15, "speed": "-6000 rpm"}
    assert changed(cluster__rotor=backwards).cluster.rotor.inertia[0, 0] > 0.0


# ---- legs


def legs_with(lower, upper, **more) -> dict:
    """Legs of the built-in between other joints (z of `upper` from the base plate)."""
    across = np.cross(np.subtract(upper, lower), [0.3, 0.5, 0.9])
    across /= np.linalg.norm(across, axis=1, keepdims=True)
    return DATA["isolator"]["legs"] | {
        "lower_joints": np.array(lower).tolist(),
        "upper_joints": np.subtract(upper, [0.0, 0.0, ZHANG.isolator.separation]).tolist(),
        "universal_axes": across.tolist(),
        **more,
    }


def test_same_leg_twice_but_shared_joints_are_fine():
    upper, lower = CUBIC_UPPER.copy(), CUBIC_LOWER.copy()
    assert (upper[0] == upper[3]).all()  # the paper's own legs share joints
    twice = legs_with(np.vstack([lower, lower[2]]), np.vstack([upper, upper[2]]))
    message = problem(isolator__legs=twice)
    assert "isolator.legs.upper_joints[6]: leg 6 is leg 2 again" in message


def test_zero_length_leg():
    legs = copy.deepcopy(DATA["isolator"]["legs"])
    legs["upper_joints"][1] = [-0.5, 0.0, -ZHANG.isolator.separation]
    message = problem(isolator__legs=legs)
    assert "isolator.legs.upper_joints[1]: leg 1 has zero length" in message


def test_universal_axis_along_the_leg():
    legs = copy.deepcopy(DATA["isolator"]["legs"])
    s = (CUBIC_UPPER - CUBIC_LOWER)[4]
    legs["universal_axes"][4] = (s / np.linalg.norm(s)).tolist()
    message = problem(isolator__legs=legs)
    assert "isolator.legs.universal_axes[4]: expected an axis across the leg, got" in message
    assert "parallel to leg 4" in message
    assert "isolator.legs.universal_axes[4]" in problem(
        isolator__legs=legs, isolator__mount="rigid"
    )


def test_less_than_three_legs():
    legs = legs_with(CUBIC_LOWER[:2], CUBIC_UPPER[:2])
    assert "isolator.legs.upper_joints: expected at least 3 legs, got 2" in problem(
        isolator__legs=legs
    )


@pytest.mark.parametrize("count", [3, 4, 5])
def test_fewer_than_six_struts_leave_a_direction_free(count):
    """Each strut is one line of force: six directions take six of them, wherever they stand."""
    rng = np.random.default_rng(count)
    for _ in range(20):
        lower, upper = rng.uniform(-1.0, 1.0, (2, count, 3))
        s = (upper - lower) / np.linalg.norm(upper - lower, axis=1, keepdims=True)
        wrenches = np.hstack([s, np.cross(upper, s)])  # of unit forces along the legs
        assert np.linalg.matrix_rank(wrenches) < 6
    message = problem(isolator__legs=legs_with(CUBIC_LOWER[:count], CUBIC_UPPER[:count]))
    assert f"these {count} leave free: " in message
    assert "a strut resists along its own line alone, so it takes six" in message


def test_leg_lists_must_be_of_one_length():
    legs = DATA["isolator"]["legs"] | {"lower_joints": CUBIC_LOWER[:5].tolist()}
    assert (
        "isolator.legs.lower_joints: expected 6 entries, one for each of upper_joints, got 5"
        in problem(isolator__legs=legs)
    )


def test_each_leg_may_have_its_own_values():
    part = DATA["isolator"]["legs"]["upper_part"]
    parts = [part | {"mass": 0.1 * i} for i in range(6)]
    legs = DATA["isolator"]["legs"] | {
        "stiffness": ["20 kN/m", 1, 2, 3, 4, 5],
        "upper_part": parts,
        "free_length": "60 cm",
    }
    scenario = changed(isolator__legs=legs)
    assert scenario.isolator.legs.stiffness == (20e3, 1.0, 2.0, 3.0, 4.0, 5.0)
    assert [each.mass for each in scenario.isolator.legs.upper_part] == pytest.approx(
        [0.0, 0.1, 0.2, 0.3, 0.4, 0.5]
    )
    assert scenario.isolator.legs.free_length == 0.6
    assert Scenario.from_yaml(scenario.to_yaml()) == scenario
    parts[2] = part | {"mass": "1 m"}
    assert "isolator.legs.upper_part[2].mass: expected a mass" in problem(isolator__legs=legs)


def test_massless_legs():
    nothing = {"mass": 0, "distance": 0, "transverse_inertia": 0, "axial_inertia": 0}
    legs = DATA["isolator"]["legs"] | {"upper_part": nothing, "lower_part": nothing}
    assert changed(isolator__legs=legs).isolator.legs.upper_part.mass == 0.0


def ring(n, radius, z, turn=0.0):
    a = 2.0 * np.pi * np.arange(n) / n + turn
    return np.stack([radius * np.cos(a), radius * np.sin(a), np.full(n, z)], axis=1)


TOWARDS_Z = (
    np.vstack([ring(3, 1.0, 0.0), ring(3, 1.0, 0.0, turn=1.0)]),
    np.vstack([ring(3, 0.5, 1.0), ring(3, 0.3, 0.8, turn=1.0)]),
)


@pytest.mark.parametrize(
    ("lower", "upper", "free"),
    [
        pytest.param(
            ring(6, 1.0, 0.0),
            ring(6, 1.0, 1.0),
            [
                "rotation about [0, 0, 1] through [0, 0, 1]",
                "translation along [1, 0, 0]",
                "translation along [0, 1, 0]",
            ],
            id="six upright legs",
        ),
        pytest.param(
            *TOWARDS_Z,
            ["rotation about [0, 0, 1] through [0, 0, 0.9]"],
            id="all legs point at the z axis",
        ),
        pytest.param(
            # two hyperboloids; on both (r x s)_z = s_z, so w_z needs v_z = -w_z
            np.vstack([ring(3, 1.0, 0.0), ring(3, 1.0, 0.0, turn=1.0)]),
            np.vstack([ring(3, 1.0, 1.0, np.pi / 2), ring(3, 2.0, 1.0, 1.0 + np.pi / 6)]),
            ["screw motion about [0, 0, 1] through [0, 0, 1], -1 m/rad"],
            id="all legs wind round z alike",
        ),
        pytest.param(
            ring(6, 1.0, 0.0),
            np.array([[0.0, 0.0, 1.0]] * 6),
            [
                "rotation about [1, 0, 0] through [0, 0, 1]",
                "rotation about [0, 1, 0] through [0, 0, 1]",
                "rotation about [0, 0, 1] through [0, 0, 1]",
            ],
            id="all legs meet in one point",
        ),
    ],
)
def test_free_directions_of_known_mechanisms(lower, upper, free):
    assert free_directions(lower, upper) == free


def test_cubic_hexapod_holds_its_plate():
    assert free_directions(CUBIC_LOWER, CUBIC_UPPER) == []
    assert free_directions(1e-3 * CUBIC_LOWER, 1e-3 * CUBIC_UPPER) == []


@settings(max_examples=30)
@given(st.integers(0, 2**32 - 1), st.integers(3, 5))
def test_reported_motion_leaves_every_leg_its_length(seed, n):
    """Oracle: move the plate a little along the motion that the text describes."""
    rng = np.random.default_rng(seed)
    lower, upper = rng.uniform(-1, 1, (2, n, 3))
    upper[:, 2] += 3.0
    described = free_directions(lower, upper)
    assert len(described) == 6 - n
    length = np.linalg.norm(upper - lower, axis=1)
    for text in described:
        axis, point = (
            np.array([float(x) for x in group.split(",")])
            for group in re.findall(r"\[(.*?)\]", text)
        )
        pitch = float(m[1]) if (m := re.search(r", (\S+) m/rad", text)) else 0.0
        rate = np.cross(axis, upper - point) + pitch * axis
        # the text has four digits
        assert np.abs(np.sum((upper - lower) * rate, axis=1) / length).max() < 5e-3 * (
            1.0 + np.abs(point).max() + abs(pitch)
        )


@pytest.mark.parametrize("mount", ["isolated", "rigid"])
def test_legs_that_do_not_hold_the_plate(mount):
    legs = legs_with(*TOWARDS_Z)
    assert (
        "isolator.legs: expected legs that hold the plate in all six directions; these 6 leave "
        "free: rotation about [0, 0, 1] through [0, 0, 0.9] (base-plate frame)"
    ) in problem(isolator__legs=legs, isolator__mount=mount)


# ---- cluster

UNITS = [
    {"position": [0.4, 0, 0], "gimbal_axis": [0, 0, 1], "spin_axis": [1, 0, 0]},
    {"position": [-0.4, 0, 0], "gimbal_axis": [0.6, 0.8, 0], "spin_axis": [0, 0, 1]},
]


def cluster_of(units, **more):
    common = {key: DATA["cluster"][key] for key in ("gimbal_body", "rotor", "gimbal_bandwidth")}
    return common | {"units": units} | more


def test_pyramid_of_four_has_no_momentum_at_zero():
    placed = ZHANG.cluster.placed()
    assert np.sum([unit.spin_axis for unit in placed], axis=0) == pytest.approx(0.0, abs=1e-15)
    assert np.sum([unit.position for unit in placed], axis=0) == pytest.approx(0.0, abs=1e-15)


def test_pyramid_follows_the_convention():
    """Unit 1 of 4: azimuth 90 deg, gimbal axis leaning out by the skew, spin axis z x r = -x."""
    unit = changed(
        cluster__pyramid={"skew": "30 deg", "radius": 2, "height": 0.5}
    ).cluster.placed()[1]
    assert unit.position == pytest.approx((0.0, 2.0, 0.5), abs=1e-15)
    assert unit.gimbal_axis == pytest.approx((0.0, 0.5, np.sqrt(0.75)), abs=1e-15)
    assert unit.spin_axis == pytest.approx((-1.0, 0.0, 0.0), abs=1e-15)


def test_units_take_what_they_do_not_say_from_the_cluster():
    units = [
        UNITS[0] | {"rotor": {"spin_inertia": 0.024}},
        UNITS[1] | {"gimbal_body": {"mass": "11 kg"}},
    ]
    scenario = changed(cluster=cluster_of(units))
    first, second = scenario.cluster.placed()
    assert first.rotor.spin_inertia == 0.024
    assert first.rotor.momentum is None  # replaced, not contradicted
    assert first.rotor.static_imbalance == ZHANG.cluster.rotor.static_imbalance
    assert first.gimbal_body == ZHANG.cluster.gimbal_body
    assert second.rotor == ZHANG.cluster.rotor
    assert second.gimbal_body.mass == 11.0
    assert second.gimbal_body.inertia == (0.06, 0.06, 0.06)
    assert Scenario.from_yaml(scenario.to_yaml()) == scenario
    faster = scenario.with_overrides({"cluster.rotor.speed": "7000 rpm"})
    assert [unit.rotor.speed for unit in faster.cluster.placed()] == [
        faster.cluster.rotor.speed
    ] * 2
    assert faster.cluster.placed()[0].rotor.spin_inertia == 0.024
    units[0]["rotor"] = {"mass": "1 m", "spead": 3}
    message = problem(cluster=cluster_of(units))
    assert "cluster.units[0].rotor.mass: expected a mass in kg, got '1 m' (a length?)" in message
    assert "cluster.units[0].rotor.spead: unknown key 'spead'; did you mean 'speed'?" in message


@pytest.mark.parametrize(
    ("spin_axis", "message"),
    [
        ([0, 0, -1], "spin_axis: expected an axis across the gimbal axis, got [0, 0, -1], which "),
        (
            [0.6, 0, 0.8],
            "spin_axis: expected an axis at right angles to the gimbal axis, got "
            "[0.6, 0, 0.8]; projected: [1, 0, 0]",
        ),
        (
            [2, 0, 0],
            "spin_axis: expected a unit vector, got [2.0, 0.0, 0.0] (its length is 2; "
            "normalised: [1, 0, 0])",
        ),
    ],
)
def test_wrong_spin_axis(spin_axis, message):
    units = [UNITS[0] | {"spin_axis": spin_axis}]
    assert "cluster.units[0]." + message in problem(cluster=cluster_of(units))


def test_pyramid_or_units():
    message = "cluster: expected exactly one of pyramid and units, got "
    both = cluster_of(UNITS, pyramid=DATA["cluster"]["pyramid"])
    assert message + "both" in problem(cluster=both)
    neither = {key: value for key, value in cluster_of([]).items() if key != "units"}
    assert message + "neither" in problem(cluster=neither)
    assert "cluster.units: expected a list of one or more units, got []" in problem(
        cluster=cluster_of([])
    )


# ---- control, target, loads


def test_pid_by_its_zeros_is_the_papers():
    """Section 8: K = 2500, zeros 0.079 and 5e-4, i.e. Kp = 200, Ki = 0.1, Kd = 2500."""
    control = {"pid": {"gain": 2500, "zeros": [0.079, "5e-4 1/s"]}}
    scenario = changed(control=control)
    pid = scenario.control.pid
    s = 0.3 + 0.2j
    expected = 2500 * (s + 0.079) * (s + 5e-4) / s
    assert pid.kp + pid.ki / s + pid.kd * s == pytest.approx(expected, rel=1e-14)
    assert pid.kp == pytest.approx(200, rel=0.01)
    assert pid.ki == pytest.approx(0.1, rel=0.02)
    assert Scenario.from_yaml(scenario.to_yaml()) == scenario


def test_control_none():
    scenario = changed(control="none")
    assert scenario.control is None
    assert "control: none" in scenario.to_yaml()


def test_control_with_its_value_forgotten_does_not_switch_it_off():
    assert "control: expected none, or a mapping with keys" in problem(control=None)


def test_output_that_no_memory_holds_is_refused_with_the_rate_that_would_do():
    message = problem(simulation={"duration": 100.0, "output_rate": "1 GHz"})
    assert "simulation.output_rate: expected at most 2e+05 Hz for 100 s" in message


@pytest.mark.parametrize("wrong", [{"relative": 1e-18}, {"relative": 10.0}, {"absolute": 1e-22}])
def test_tolerances_that_cannot_be_met_or_mean_nothing_are_refused(wrong):
    assert "expected a number from" in problem(simulation={"tolerances": wrong})


def test_rotor_phases_left_out_are_drawn_evenly_and_alike_each_time():
    """Uniform over the turn: the mean of exp(i phi) of n draws is of size 1/sqrt(n)."""
    cluster = {
        k: v for k, v in DATA["cluster"].items() if k not in ("rotor_phases", "gimbal_angles")
    }
    cluster["pyramid"] = cluster["pyramid"] | {"units": 400}
    drawn, again = (Scenario.from_dict(DATA | {"cluster": cluster}).cluster for _ in range(2))
    assert drawn.rotor_phases == "random"
    assert drawn.phases() == again.phases()
    phases = np.array(drawn.phases())
    assert np.all(np.abs(phases) <= np.pi)
    assert np.abs(np.mean(np.exp(1j * phases))) < 3.0 / np.sqrt(400)
    assert len(np.unique(phases)) == 400
    assert drawn.phases(first=7)[:3] == drawn.phases()[7:10]
    other = cluster | {"rotor": cluster["rotor"] | {"disturbance": {"seed": 1}}}
    assert not set(Scenario.from_dict(DATA | {"cluster": other}).cluster.phases()) & set(phases)
    given = cluster | {"pyramid": DATA["cluster"]["pyramid"], "rotor_phases": ["90 deg", 0, 0, 1]}
    assert Scenario.from_dict(DATA | {"cluster": given}).cluster.phases() == (np.pi / 2, 0, 0, 1)


@pytest.mark.parametrize("wrong", ["randon", "0.7 rad", 0.7])
def test_rotor_phases_are_random_or_a_list(wrong):
    message = problem(cluster=DATA["cluster"] | {"rotor_phases": wrong})
    assert "cluster.rotor_phases: expected random, or a list of one or more angles, got" in message


def test_pseudo_inverse_needs_three_units():
    cluster = DATA["cluster"] | {"pyramid": DATA["cluster"]["pyramid"] | {"units": 2}}
    for key in ("rotor_phases", "gimbal_angles"):
        cluster.pop(key, None)
    control = DATA["control"] | {"steering": {"law": "pseudo_inverse"}}
    message = problem(cluster=cluster, control=control)
    assert "control.steering.law: expected singularity_robust or none for fewer than" in message


@pytest.mark.parametrize(
    "law", ["singularity_robust", "generalized_singularity_robust", "pseudo_inverse", "none"]
)
def test_steering_laws(law):
    scenario = changed(control__steering={"law": law})
    steering = scenario.control.steering
    assert steering.law == law
    if "robust" in law:
        assert (steering.lambda0, steering.mu) == (0.01, 10.0)
    if law.startswith("generalized"):
        assert steering.frequency == pytest.approx(np.pi / 2)
        assert steering.phases == pytest.approx((0.0, np.pi / 2, np.pi))
    assert Scenario.from_yaml(scenario.to_yaml()) == scenario


def test_loads_of_every_profile():
    loads = [
        {"body": "plate", "force": ["10 N", 0, 30], "frame": "inertial"},
        {"body": "bus", "torque": [0, "1 N*mm", 0], "profile": {"step": {"start": "1 s"}}},
        {"body": "bus", "profile": {"half_sine": {"start": 1, "duration": "20 ms"}}},
        {"body": "bus", "profile": {"table": {"times": [0, "1 s"], "values": [0, -1]}}},
    ]
    scenario = changed(loads=loads)
    assert scenario.loads[0].force == (10.0, 0.0, 30.0)
    assert scenario.loads[1].torque == pytest.approx((0.0, 1e-3, 0.0))
    assert scenario.loads[1].profile.step.end is None
    assert scenario.loads[2].profile.half_sine.duration == pytest.approx(0.02)
    assert scenario.loads[3].profile.table.times == (0.0, 1.0)
    assert Scenario.from_yaml(scenario.to_yaml()) == scenario


@pytest.mark.parametrize(
    ("load", "message"),
    [
        ({"body": "buss"}, "body: expected a body, one of bus, plate; got 'buss'"),
        ({"force": [1, 2, "3 N*m"]}, "force[2]: expected a force in N, got '3 N*m' (a torque?)"),
        ({"profile": "steps"}, "profile: expected constant or a mapping with one of step, half_"),
        (
            {"profile": {}},
            "profile: expected constant, or one of step, half_sine, table; got neither",
        ),
        (
            {"profile": {"step": {"start": 0}, "half_sine": {"start": 0, "duration": 1}}},
            "profile: expected constant, or one of step, half_sine, table; got step and half_sine",
        ),
        (
            {"profile": {"step": {"start": 2, "end": 1}}},
            "profile.step.end: expected a time after start (2 s), got 1",
        ),
        (
            {"profile": {"table": {"times": [0, 1, 1], "values": [0, 1, 2]}}},
            "profile.table.times[2]: expected a time after 1 s, the one before, got 1",
        ),
        (
            {"profile": {"table": {"times": [0, 1], "values": [0]}}},
            "profile.table.values: expected 2 numbers, one for each time, got 1",
        ),
    ],
)
def test_wrong_load(load, message):
    assert f"s: loads[0].{message}" in problem(loads=[{"body": "bus"} | load])


def test_loads_must_be_a_list():
    assert "s: loads: expected a list of any number of loads, got a mapping" in problem(
        loads={"body": "bus"}
    )


# ---- round trip


angles = st.floats(-3, 3)
positive = st.floats(1e-6, 1e6)
vectors = st.tuples(*[st.floats(-10, 10)] * 3)


@st.composite
def units(draw):
    """A CMG anywhere, axes from any two directions."""
    a, b = np.array(draw(vectors)), np.array(draw(vectors))
    g = a / np.linalg.norm(a) if np.linalg.norm(a) > 0.1 else np.array([0.0, 0.0, 1.0])
    s = np.cross(g, b)
    if np.linalg.norm(s) < 0.1:
        s = np.cross(g, [g[1], g[2], -g[0] + 0.5])
    s /= np.linalg.norm(s)
    off = draw(st.floats(0.9995, 1.0005))  # nearly unit is normalised
    return {
        "position": draw(vectors),
        "gimbal_axis": (off * g).tolist(),
        "spin_axis": s.tolist(),
    }


@settings(max_examples=40, deadline=None)
@given(st.lists(units(), min_size=1, max_size=4), vectors, positive, angles, st.data())
def test_every_scenario_comes_back_from_its_yaml(some_units, vector, number, angle, data):
    scenario = changed(
        cluster=cluster_of(some_units, gimbal_rate_limit=number),
        initial={"attitude": [angle] * 3, "rate": vector},
        isolator__offset=vector,
        simulation={"duration": min(number, 1e3), "output_rate": min(number, 1e4)},
        name=data.draw(st.text().filter(lambda text: name_defect(text) is None)),
    )
    assert Scenario.from_yaml(scenario.to_yaml()) == scenario
    for unit in scenario.cluster.placed():
        assert np.linalg.norm(unit.gimbal_axis) == pytest.approx(1.0, abs=1e-15)
