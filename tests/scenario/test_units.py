"""Quantities: values in SI, and refusals that name the field's unit and what came."""

import math
import subprocess
import sys

import pytest
from hypothesis import given
from hypothesis import strategies as st
from pydantic_core import PydanticCustomError

from quietbus.scenario.units import Quantity

ANGLE = Quantity("an angle", "rad")
SPEED = Quantity("an angular velocity", "rad/s")
RATE = Quantity("a frequency", "Hz", above=0.0)
MASS = Quantity("a mass", "kg", above=0.0)
LENGTH = Quantity("a length", "m")
DAMPING = Quantity("a damping", "N*s/m", least=0.0)
FRICTION = Quantity("a joint friction", "N*m*s/rad", least=0.0)
NUMBER = Quantity("a plain number", "")


def refusal(quantity: Quantity, value: object) -> str:
    with pytest.raises(PydanticCustomError) as error:
        quantity.read(value)
    return error.value.message()


@pytest.mark.parametrize(
    ("quantity", "text", "value"),
    [
        (Quantity("a stiffness", "N/m"), "20 kN/m", 20e3),
        (SPEED, "6000 rpm", 200 * math.pi),
        (SPEED, "100 rev/s", 200 * math.pi),
        (SPEED, "180 deg/s", math.pi),
        (ANGLE, "1.5 deg", 1.5 * math.pi / 180),
        (ANGLE, "-90°", -math.pi / 2),
        (ANGLE, "1 arcsec", math.pi / 648000),
        (Quantity("a static imbalance", "kg*m"), "1.36 g*cm", 1.36e-5),
        (Quantity("a dynamic imbalance", "kg*m^2"), "17 g*cm^2", 1.7e-6),
        (Quantity("a dynamic imbalance", "kg*m^2"), "17 g·cm²", 1.7e-6),
        (Quantity("an angular jerk", "rad/s^3"), "180 deg/s**3", math.pi),
        (RATE, "1 kHz", 1000.0),
        (RATE, "60 1/min", 1.0),
        (MASS, "1 lb", 0.45359237),
        (MASS, "2.5kg", 2.5),
        (LENGTH, "12 in", 0.3048),
        (Quantity("a torque", "N*m"), "1 lbf*ft", 1.3558179483314004),
        (Quantity("an angular momentum", "N*m*s"), "15 kg m^2/s", 15.0),
        (FRICTION, "1e-4 N*m*s", 1e-4),
        (FRICTION, "1e-4 N*m*s/rad", 1e-4),
        (Quantity("a proportional gain", "N*m/rad"), "1 N*m/deg", 180 / math.pi),
        (NUMBER, "5 %", 0.05),
        (NUMBER, "1e-8", 1e-8),
        (LENGTH, "1e-4", 1e-4),
        (LENGTH, "+.5", 0.5),
        (LENGTH, 3, 3.0),
    ],
)
def test_quantity_in_si(quantity, text, value):
    assert quantity.read(text) == pytest.approx(value, rel=1e-15, abs=0.0)


@pytest.mark.parametrize(
    ("quantity", "value", "message"),
    [
        (DAMPING, "500 N/m", "expected a damping in N*s/m, got '500 N/m' (a stiffness?)"),
        (
            SPEED,
            "100 Hz",
            "expected an angular velocity in rad/s, got '100 Hz' "
            "(turns or radians? write rpm, rev/s, deg/s or rad/s)",
        ),
        (
            RATE,
            "6000 rpm",
            "expected a frequency in Hz, got '6000 rpm' "
            "(an angular velocity? frequencies are in Hz)",
        ),
        (ANGLE, "3 m", "expected an angle in rad, got '3 m' (a length?)"),
        (ANGLE, "3 %", "expected an angle in rad, got '3 %' (turns or radians? write rad)"),
        (LENGTH, "3 rad*m^3", "expected a length in m, got '3 rad*m^3' (another dimension)"),
        (NUMBER, "3 s", "expected a plain number, got '3 s' (a time?)"),
        (
            LENGTH,
            "20 kN/metre?",
            "expected a length in m, got '20 kN/metre?' ('kN/metre?' is not a unit)",
        ),
        (
            DAMPING,
            "5 newtn",
            "expected a damping in N*s/m, got '5 newtn' "
            "(unknown unit 'newtn'; did you mean 'newton'?)",
        ),
        (
            FRICTION,
            "5 Nms",
            "expected a joint friction in N*m*s/rad, got '5 Nms' "
            "(unknown unit 'Nms'; products are written with *, as in N*m)",
        ),
        (DAMPING, "5 Ns/m", "unknown unit 'Ns'; products are written with *, as in N*m"),
        (FRICTION, "5 N.m.s", "'N.m.s' is not a unit; products are written with *: N*m*s"),
        (SPEED, "6000 r/min", "unknown unit 'r'; turns are rev, as in rev/min, which is rpm"),
        (SPEED, "6000 U/min", "unknown unit 'U'; turns are rev, as in rev/min, which is rpm"),
        (LENGTH, "20 degC", "got '20 degC' (unknown unit 'degC'"),
        (LENGTH, "5 kg**1e9", "got '5 kg**1e9' ("),
        (LENGTH, "5 m^9^9^9^9", "got '5 m^9^9^9^9' ('m^9^9^9^9' is not a unit)"),
        (LENGTH, "5 m^(9^9^9)", "'m^(9^9^9)' is not a unit"),
        (LENGTH, "5 (", "got '5 (' ('(' is not a unit)"),
        (LENGTH, "5 **", "got '5 **' ("),
        (LENGTH, "five", "expected a length in m, got 'five'"),
        (LENGTH, "", "expected a length in m, got ''"),
        (LENGTH, "1__0", "got '1__0' ("),
        (LENGTH, "nan", "expected a length in m, got 'nan'"),
        (LENGTH, "1e999 m", "got '1e999 m' (not a finite number)"),
        (LENGTH, math.nan, "got nan (not a finite number)"),
        (LENGTH, -math.inf, "got -inf (not a finite number)"),
        (LENGTH, 10**400, "(not a finite number)"),
        (LENGTH, True, "expected a length in m, got true"),
        (LENGTH, None, "expected a length in m, got nothing"),
        (LENGTH, [1.0], "expected a length in m, got [1.0]"),
        (LENGTH, {"a": 1}, "expected a length in m, got a mapping"),
        (MASS, 0, "expected a mass in kg, got 0 (must be above 0)"),
        (DAMPING, "-1 N*s/m", "got '-1 N*s/m' (must be at least 0)"),
    ],
)
def test_refusal_says_what_was_expected_and_what_came(quantity, value, message):
    assert message in refusal(quantity, value)


@pytest.mark.parametrize("unit", ["1/s", "Hz", "1/min"])
@pytest.mark.parametrize("power", [1, 2, 3])
def test_angular_fields_demand_an_angle(unit, power):
    names = {1: "rad/s", 2: "rad/s^2", 3: "rad/s^3"}
    assert "turns or radians?" in refusal(Quantity("it", names[power]), f"1 ({unit})^{power}")


@given(
    st.floats(-1e12, 1e12),
    st.sampled_from([("mm", 1e-3), ("km", 1e3), ("ft", 0.3048)]),
)
def test_unit_scales_the_number(number, unit):
    name, factor = unit
    assert LENGTH.read(f"{number!r} {name}") == pytest.approx(number * factor, rel=1e-15)


@given(st.text())
def test_no_text_escapes_as_another_error(text):
    for quantity in (LENGTH, SPEED):
        for value in (text, "3 " + text):
            try:
                number = quantity.read(value)
            except PydanticCustomError:
                continue
            assert math.isfinite(number)


def test_scenarios_need_no_jax():
    code = (
        "import sys; from quietbus.scenario import load_scenario; load_scenario('zhang2012'); "
        "sys.exit('jax' in sys.modules)"
    )
    assert subprocess.run([sys.executable, "-c", code], check=False).returncode == 0
