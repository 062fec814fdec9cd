"""The whole linear analysis of a scenario: the paper's numbers, odd scenarios, and invariance."""

import re
from pathlib import Path

import numpy as np
import pytest

import quietbus as qb
from oracles.pages import assert_rounds, table
from quietbus.analysis.control.loop import attitude_loop
from quietbus.analysis.control.nyquist import stable_gain_range
from quietbus.dynamics.linearize import platform_inertia
from quietbus.studies.linear import at_height, without_leg_mass

LEGS = ("upper_joints", "lower_joints", "universal_axes")


def changed(overrides, name="zhang2012"):
    return qb.load_scenario(name).with_overrides(overrides)


@pytest.fixture(scope="module")
def paper():
    return qb.analyze("zhang2012")


def test_paper_per_axis(paper):
    """Section 8 of the paper; exact coefficients 70.4 and 0.03623 instead of the printed ones."""
    x = paper.loop_analyses["x"]
    ((low, high),) = x.stable_gain_range
    assert low == pytest.approx(0.55, abs=0.001)  # 0.547 from the rounded zeros of the PID
    assert high == pytest.approx(9122.0, abs=1.0)
    assert x.gain_margins_db == pytest.approx((-73.15, 11.24), abs=0.01)
    assert x.phase_margin_deg == pytest.approx(87.96, abs=0.02)
    assert x.crossover_hz == pytest.approx(0.3693, abs=1e-4)
    assert paper.channels.x.peak_frequency_hz == pytest.approx(2.469, abs=0.001)
    assert paper.channels.z.undamped_frequencies_hz == pytest.approx((5.033,), abs=1e-3)
    assert paper.rules["x"].passed
    assert paper.rules["x"].ratio == pytest.approx(6.7, abs=0.05)


def test_truth_is_far_below_what_the_axes_say(paper):
    """One simplification lifted at a time; the place of the platform matters most."""
    upper = {row["case"]: row["stable_gain_range"][0][1] for row in paper.truth}
    x, y, z, center, place, friction, legs, momentum, servo = upper.values()
    assert min(x, y, z) == y == pytest.approx(7463.0, abs=1.0)
    assert center > 4.0 * y
    assert place == pytest.approx(3957.0, abs=1.0)
    for before, after in ((place, friction), (friction, legs), (legs, momentum), (momentum, servo)):
        assert after == pytest.approx(before, rel=0.02)
    assert servo == paper.coupled.stable_gain_range[0][1] == pytest.approx(3866.0, abs=1.0)
    assert paper.coupled.gain_margin_db == pytest.approx(20 * np.log10(servo / 2500.0))


def test_rotor_momentum_acts_where_gimbals_are_turned():
    """At zero gimbal angles the units' momenta cancel; turned alike they do not."""
    rows = qb.analyze("zhang2012", np.full(4, 0.5)).truth
    legs, momentum = (row["stable_gain_range"][0][1] for row in rows[-3:-1])
    assert abs(momentum / legs - 1.0) > 1e-4


def test_limits_by_height_are_those_of_a_scenario_so_built(paper):
    """Moving the platform of the model is moving it in the scenario."""
    moved = qb.analyze(changed({"isolator.offset": [0.0, 0.0, 0.2]}))
    height = 0.2 + paper.scenario.isolator.separation
    limits = paper.limits_by_height(np.array([height, 0.6 + paper.scenario.isolator.separation]))
    assert limits[0] == pytest.approx(moved.coupled.stable_gain_range[0], rel=1e-8)
    assert limits[1] == pytest.approx(paper.coupled.stable_gain_range[0], rel=1e-8)
    satellite = at_height(paper.satellite, height)
    np.testing.assert_allclose(
        satellite.mounts[0].p_BX_B, moved.satellite.mounts[0].p_BX_B, atol=1e-14
    )
    for leaf in ("p_PU_P", "p_BA_B", "nominal_length"):
        here, there = (
            np.asarray(getattr(s.hexapods[0].geometry, leaf)) for s in (satellite, moved.satellite)
        )
        np.testing.assert_allclose(here, there, atol=1e-14)


def test_legs_without_mass_keep_their_struts(paper):
    (light,) = without_leg_mass(paper.satellite).hexapods
    assert float(light.bodies.upper.mass.sum() + light.bodies.lower.axial_inertia.sum()) == 0.0
    np.testing.assert_array_equal(
        light.strut.stiffness, paper.satellite.hexapods[0].strut.stiffness
    )


# --- the numbers of docs/analysis.md ------------------------------------------------------------

PAGE = (Path(__file__).parents[2] / "docs" / "analysis.md").read_text(encoding="utf-8")


def test_page_has_the_limits_one_simplification_lifted_at_a_time(paper):
    shown = table(PAGE, ("what", "stable K", "margin against more gain"))
    for (what, limits, margin), row in zip(shown, paper.truth, strict=True):
        (ends,) = row["stable_gain_range"]
        assert_rounds(limits.replace(" to ", " , "), *ends)
        assert_rounds(margin, 20.0 * np.log10(ends[1] / 2500.0))
        assert what.startswith("per axis") == row["case"].startswith("per axis")


def test_page_has_the_limits_by_height(paper):
    heights, limits = (
        [cell.strip() for cell in row.strip("| ").split("|")][1:]
        for row in PAGE.splitlines()
        if row.startswith(("| height, m", "| upper limit of K |"))
    )
    heights = np.array([float(height.replace("−", "-")) for height in heights])
    # the plate's place in the built-in satellite is 0.6 m + sqrt(2)/4 m
    heights = np.where(np.isin(heights, (0.354, 0.954)), heights + 0.25 * 2**0.5 - 0.354, heights)
    for limit, (_, high) in zip(limits, paper.limits_by_height(heights), strict=True):
        assert_rounds(limit, high)


@pytest.mark.slow
def test_page_has_limits_and_jitter_by_stiffness_and_damping():
    for legs, limit, jitter in table(PAGE, ("legs", "upper limit of K", "jitter that passes")):
        stiffness, damping = re.search(r"(\d+) kN/m, (\d+) N s/m", legs).groups()
        study = qb.analyze(
            changed(
                {
                    "isolator.legs.stiffness": 1e3 * float(stiffness),
                    "isolator.legs.damping": float(damping),
                }
            )
        )
        assert_rounds(limit, study.coupled.stable_gain_range[-1][1])
        passes = study.transmissibility(np.array([100.0])).rate_ratio[0, 1]
        assert_rounds(jitter, 100.0 * passes)


def test_page_says_what_the_lever_does(paper):
    """Its formula for G_H with polynomials of NumPy, about y."""
    mass, _, inertia = platform_inertia(paper.satellite, np.zeros(4), "plate")
    legs = paper.scenario.isolator.legs
    u = np.array([np.ravel(legs.damping)[0], np.ravel(legs.stiffness)[0]])
    a, b, d = 2.0, 0.25 * np.sqrt(2.0), 0.25
    delta = a * d - b**2
    assert delta == pytest.approx(3.0 / 8.0)
    base = paper.scenario.isolator.separation

    def channel(height):
        end = delta * np.polymul(u, u)
        top = np.polymul(u, np.polyadd([(d - b * height) * mass, 0.0, 0.0], delta * u))
        middle = np.polymul(u, [mass * d + inertia[1, 1] * a, 0.0, 0.0])
        bottom = np.polyadd(np.polyadd([mass * inertia[1, 1], 0, 0, 0, 0], middle), end)
        return top, bottom

    def limit(height, bus):
        (ends,) = stable_gain_range(attitude_loop(*channel(height), bus, paper.pid))
        return ends[1]

    def zeros(height):  # those that u does not bring
        return np.roots(np.polyadd([(d - b * height) * mass, 0.0, 0.0], delta * u))

    assert d - b * base == pytest.approx(0.125)
    assert limit(base, 900.0) == pytest.approx(paper.loop_analyses["y"].stable_gain_range[0][1])
    bus = float(paper.satellite.bus.mass_X)
    lever = bus * mass / (bus + mass) * (base + 0.6) ** 2  # about the common mass centre
    modes = np.sort(np.unique(np.abs(np.roots(channel(base)[1])).round(6))) / (2.0 * np.pi)
    for said, here in (
        (r"modes \((.*?) and (.*?) Hz\)", modes),
        (r"have reached ([\d.]+) Hz", [np.abs(zeros(base)[0]) / (2.0 * np.pi)]),
        (r"H = d/b = ([\d.]+) m", [d / b]),
        (r"right half-plane, at (\d+) rad/s", [zeros(base + 0.6).real.max()]),
        (r"about y from 7463 to (\d+)", [limit(base + 0.6, 900.0)]),
        (r"mass centre \(900 \+ (\d+) kg m²\) to", [lever]),
        (r"kg m²\) to (\d+)\.", [limit(base + 0.6, 900.0 + lever)]),
        (r"1000 against ([\d.]+) kg", [mass]),
    ):
        numbers = re.search(said, " ".join(PAGE.split()))
        assert numbers, said
        for shown, value in zip(numbers.groups(), here, strict=True):
            assert_rounds(shown, value)


# --- odd scenarios -----------------------------------------------------------------------------


def test_without_control_the_loops_are_empty_and_it_is_said():
    study = qb.analyze(changed({"control": "none"}))
    found = study.to_dict()
    assert [found[key] for key in ("loop", "rules", "coupled", "truth")] == [None] * 4
    assert any("no control" in note for note in found["notes"])
    assert len(found["modes"]["free"]) == 6
    assert found["channels"]["x"]["peak_gain"] > 1.0
    with pytest.raises(ValueError, match="no control"):
        study.limits_by_height(np.zeros(1))


def test_gains_of_zero_are_no_control():
    found = qb.analyze(changed({"control.pid": {"kp": 0, "ki": 0, "kd": 0}})).to_dict()
    assert found["coupled"] is None
    assert any("gains of zero" in note for note in found["notes"])


def test_held_gimbals_and_rigid_mounts_are_pointed_out():
    overrides = {"control.steering": {"law": "none"}, "isolator.mount": "rigid"}
    study = qb.analyze(changed(overrides))
    assert any("feels no control" in note for note in study.notes)
    assert any("mount is rigid" in note for note in study.notes)
    # analysed as if the plate received the torque: no servo in it
    assert study.coupled.stable_gain_range[0][1] == pytest.approx(3903.0, abs=1.0)


def test_unstable_loop_is_analysed_and_said():
    found = qb.analyze(changed({"control.pid": {"kp": 800, "ki": 0.4, "kd": 10_000}})).to_dict()
    assert found["loop"]["x"]["stable"] is False
    assert "Unstable" in found["loop"]["x"]["verdict"]
    assert found["coupled"]["stable"] is False
    assert found["coupled"]["gain_margin_db"] is None
    assert found["coupled"]["disk_margin"] == 0.0
    assert found["coupled"]["stable_gain_range"][0][1] == pytest.approx(3866.0, abs=1.0)


def test_gain_without_a_stable_range_is_said():
    """Integral action alone stabilises nothing."""
    found = qb.analyze(changed({"control.pid": {"kp": 0, "ki": 5, "kd": 0}})).to_dict()
    assert found["loop"]["x"]["stable_gain_range"] == []
    assert found["coupled"]["stable_gain_range"] == []
    assert "No gain K makes it stable" in found["coupled"]["verdict"]


def test_uneven_hexapod_couples_the_axes_and_it_is_said():
    stiff = [20e3, 30e3, 20e3, 20e3, 20e3, 10e3]
    study = qb.analyze(changed({"isolator.legs.stiffness": stiff}))
    assert study.channels.largest_coupling > 0.1
    assert any("channels are coupled" in note for note in study.notes)
    assert study.coupled.stable
    assert np.isfinite(study.coupled.stable_gain_range[0][1])


@pytest.mark.slow
def test_every_mode_of_eight_legs_is_found():
    """Any number of legs: two more between the first joints."""
    legs = qb.load_scenario("zhang2012").isolator.legs
    more = {f"isolator.legs.{key}": [*getattr(legs, key), *getattr(legs, key)[:2]] for key in LEGS}
    more["isolator.legs.upper_joints"][6:] = [[0.4, 0.2, 0.0], [-0.2, 0.3, 0.0]]
    study = qb.analyze(changed(more))
    assert len(study.modes["fixed_base"]) == len(study.modes["free"]) == 6
    assert study.coupled is not None


def test_wrong_gimbal_angles_are_refused():
    with pytest.raises(ValueError, match="gimbal angles: expected 4"):
        qb.analyze("zhang2012", [0.0, 0.0])


# --- invariance --------------------------------------------------------------------------------


def numbers(study, axes="xyz"):
    """What must not depend on how a satellite is described, axes in the given order."""
    found = study.to_dict()
    per_axis = [found["loop"][axis]["stable_gain_range"][0] for axis in axes]
    peaks = [found["channels"][axis]["peak_gain"] for axis in axes]
    modes = [mode["frequency_hz"] for mode in found["modes"]["free"]]
    coupled = found["coupled"]
    margins = [coupled["disk_margin"], *coupled["stable_gain_range"][0]]
    return np.concatenate([np.ravel(per_axis), peaks, modes, margins])


def test_order_of_the_legs_does_not_matter(paper):
    legs = paper.scenario.isolator.legs
    order = [3, 0, 5, 1, 4, 2]
    shuffled = {f"isolator.legs.{key}": [getattr(legs, key)[i] for i in order] for key in LEGS}
    np.testing.assert_allclose(numbers(qb.analyze(changed(shuffled))), numbers(paper), rtol=1e-7)


def test_units_do_not_matter(paper):
    text = paper.scenario.to_yaml()
    described = changed(
        {
            "bus.mass": "1 t",
            "isolator.legs.stiffness": "20 N/mm",
            "isolator.offset": ["0 mm", "0 mm", "600 mm"],
            "cluster.rotor.speed": "100 Hz" if "Hz" in text else "6000 rpm",
            "control.pid": {"kp": "0.2 kN*m", "ki": 0.1, "kd": 2500},
        }
    )
    np.testing.assert_allclose(numbers(qb.analyze(described)), numbers(paper), rtol=1e-8)


def test_a_quarter_turn_of_everything_swaps_the_axes(paper):
    """Bus, base plate (its `orientation`) and controller turned by 90 degrees about z."""
    turn = np.array([[0.0, -1.0, 0.0], [1.0, 0.0, 0.0], [0.0, 0.0, 1.0]])
    inertia = turn @ np.array(paper.scenario.bus.inertia) @ turn.T
    turned = changed(
        {"bus.inertia": inertia.tolist(), "isolator.orientation": ["0 deg", "0 deg", "90 deg"]}
    )
    np.testing.assert_allclose(numbers(qb.analyze(turned), "yxz"), numbers(paper, "xyz"), rtol=1e-7)


def test_a_quarter_turn_of_an_uneven_platform_swaps_its_channels():
    """Uneven legs under a plate with products of inertia: the channels are those of bus axes."""
    stiff = {
        "isolator.legs.stiffness": [20e3, 60e3, 20e3, 20e3, 60e3, 20e3],
        "isolator.plate.inertia": [[1.8, 0.1, 0.4], [0.1, 2.2, -0.3], [0.4, -0.3, 1.5]],
        "isolator.plate.center_of_mass": [0.2, -0.1, 0.3],
    }
    straight = qb.analyze(changed(stiff)).channels
    quarter = {"isolator.orientation": ["0 deg", "0 deg", "90 deg"]}
    turned = qb.analyze(changed(stiff | quarter)).channels
    assert straight.x.peak_gain != pytest.approx(straight.y.peak_gain, rel=1e-2)
    swapped = np.array(turned.coupling)[np.ix_([1, 0, 2], [1, 0, 2])]
    np.testing.assert_allclose(swapped, straight.coupling, rtol=1e-6)
