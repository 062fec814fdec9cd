"""Quantities with units: ``20 kN/m`` in a scenario becomes the float 20000.0.

A bare number is SI. A text is a number and a unit; its dimension must be the field's. Radian is a
base unit here, not a plain 1, so that a rotor speed in Hz (turns? radians?) can be refused. Units
are pint's, from the short list below: it loads at once, can make the radian a base unit, and has
no traps such as ``Nm`` for "number metric", a unit of yarn, in pint's own list of a thousand.
"""

from __future__ import annotations

import difflib
import functools
import math
import numbers
import re
from dataclasses import dataclass
from typing import TYPE_CHECKING, Any, cast

from pydantic import GetCoreSchemaHandler
from pydantic_core import CoreSchema, PydanticCustomError, core_schema

from quietbus.words import shown

if TYPE_CHECKING:
    import pint

DEFINITIONS = """
nano- = 1e-9 = n-
micro- = 1e-6 = µ- = μ- = u-
milli- = 1e-3 = m-
centi- = 1e-2 = c-
kilo- = 1e3 = k-
mega- = 1e6 = M-
giga- = 1e9 = G-
meter = [length] = m = metre
second = [time] = s = sec
gram = [mass] = g
radian = [angle] = rad
kelvin = [temperature] = K
ampere = [current] = A
percent = 0.01 = %
minute = 60 * second = min
hour = 60 * minute = h = hr
day = 24 * hour = d
degree = 3.141592653589793 / 180 * radian = deg = °
arcminute = degree / 60 = arcmin
arcsecond = degree / 3600 = arcsec
milliarcsecond = arcsecond / 1000 = mas
microarcsecond = arcsecond / 1000000 = uas = µas
turn = 6.283185307179586 * radian = rev = revolution = cycle
revolutions_per_minute = turn / minute = rpm = RPM
revolutions_per_second = turn / second = rps
hertz = 1 / second = Hz
newton = kilogram * meter / second ** 2 = N
joule = newton * meter = J
watt = joule / second = W
pascal = newton / meter ** 2 = Pa
tonne = 1000 * kilogram = t
inch = 0.0254 * meter = in
foot = 0.3048 * meter = ft
pound = 453.59237 * gram = lb
ounce = pound / 16 = oz
kilogram_force = 9.80665 * newton = kgf
pound_force = 4.4482216152605 * newton = lbf
ounce_force = pound_force / 16 = ozf
slug = 14.593902937206364 * kilogram
gravity = 9.80665 * meter / second ** 2 = g0
"""

LARGEST = 1e60  # whose square is still a number, and that of its inverse

# Names of dimensions, to guess what a wrong quantity was meant for.
_KNOWN = {
    "a mass": "kg",
    "a length": "m",
    "a time": "s",
    "an angle": "rad",
    "a frequency": "Hz",
    "an angular velocity": "rad/s",
    "an angular acceleration": "rad/s^2",
    "a velocity": "m/s",
    "an acceleration": "m/s^2",
    "a force": "N",
    "a torque": "N*m",
    "a stiffness": "N/m",
    "a damping": "N*s/m",
    "an angular momentum": "N*m*s",
    "a moment of inertia": "kg*m^2",
    "a static imbalance": "kg*m",
    "a temperature": "K",
    "a plain number": "",
}

Powers = dict[str, float]  # of the base dimensions: {"[length]": 1, "[time]": -1}

# Texts come from anywhere: no part of a pattern is tried again ("++", "*+"), so that the time is
# linear in the length of the text.
_NUMBER = re.compile(r"[+-]?(?:\d++(?:\.\d*+)?|\.\d++)(?:[eE][+-]?\d++)?")
# Names, their powers of one digit, and what joins them: pint would try to compute 9^9^9^9.
_POWER = r"(?:\^|\*\*)\s*+\(?\s*+[+-]?\d(?:\.\d)?(?!\s*+(?:\d|\^|\*\*))"
_UNIT = re.compile(rf"(?:[^\W\d]++|[°%²³]|{_POWER}|1(?=\s*+/)|[*/·()\s])*+")
_LONGEST_UNIT = 60
_JOINT = re.compile(r"(?<=[^\W\d])[-.](?=[^\W\d])|(?<=\^\d)[-.](?=[^\W\d])")
_PARTS = r"(?:kg|[kmM]?N|[cm]?m|ozf?|lbf?|in|ft|rad|g|s)++"
_RUN_TOGETHER = re.compile(_PARTS)
_RUN_TOGETHER_IN_ANY_CASE = re.compile(_PARTS, re.IGNORECASE)
_TURNS = ("r", "U", "tr")  # as in r/min; rev is a unit, these are not


@functools.cache
def registry() -> pint.UnitRegistry[Any]:
    """Units with the radian as a base unit; made when the first quantity is met."""
    import pint

    return pint.UnitRegistry(DEFINITIONS.strip().splitlines())


@functools.cache
def _unit(text: str) -> tuple[float, Powers]:
    """SI factor and powers of the base dimensions of a unit; ValueError says why it is none."""
    import pint

    if len(text) > _LONGEST_UNIT or not _UNIT.fullmatch(text):
        raise ValueError(f"{shown(text)} is not a unit{_meant_unit(text)}")
    try:
        units = registry().parse_units(text.replace("·", "*"))
        factor, base = cast("tuple[float, Any]", registry().get_root_units(units))
        powers: Powers = dict(base.dimensionality)
        grams = 1000.0 ** powers.get("[mass]", 0.0)  # pint's root of mass is the gram
        return factor / grams, powers
    except pint.UndefinedUnitError as error:
        names = error.unit_names
        name = names if isinstance(names, str) else names[0]
        raise ValueError(f"unknown unit '{name}'{_similar_unit(name)}") from None
    except Exception:  # pint's parser raises many kinds, from AssertionError to TokenError
        raise ValueError(f"{shown(text)} is not a unit") from None


def _meant_unit(text: str) -> str:
    """What a text that is no unit was meant for."""
    if text.startswith(",") and text[1:2].isdecimal():
        return "; numbers have a decimal point"
    product = _JOINT.sub("*", text)
    if product == text or len(text) > _LONGEST_UNIT:
        return ""
    try:
        _unit(product)
    except ValueError:
        return "; products are written with *, as in N*m"
    return f"; products are written with *: {product}"


def _similar_unit(name: str) -> str:
    products = "; products are written with *, as in N*m"
    if name in _TURNS:
        return "; turns are rev, as in rev/min, which is rpm"
    if _RUN_TOGETHER.fullmatch(name):  # before the names: Ns is no nanosecond
        return products
    same = sorted(known for known in _symbols() if known.lower() == name.lower())
    if same:
        return f"; did you mean '{same[0]}'? units mind capitals"
    if _RUN_TOGETHER_IN_ANY_CASE.fullmatch(name):
        return products
    close = difflib.get_close_matches(name, _symbols(), n=1)
    return f"; did you mean '{close[0]}'?" if close else ""


@functools.cache
def _symbols() -> tuple[str, ...]:
    """Names of units, and the usual ones behind their prefixes.

    Not the nanometre: NM and Nm are meant for a product.
    """
    lines = [[name.strip() for name in line.split("=")] for line in DEFINITIONS.strip().split("\n")]
    names = [
        alias
        for first, _, *others in lines
        for alias in (first, *others)
        if not first.endswith("-") and alias.isidentifier()
    ]
    short = ("m", "g", "s", "N", "Hz", "Pa", "W", "J", "rad", "lbf")
    return tuple(names + [prefix + unit for prefix in ("n", "u", "m", "c", "k", "M", "G")
                          for unit in short if (prefix, unit) != ("n", "m")])  # fmt: skip


def _without_angle(powers: Powers) -> Powers:
    return {name: power for name, power in powers.items() if name != "[angle]"}


def _nonzero(powers: Powers) -> Powers:
    return {name: power for name, power in powers.items() if power}


@dataclass(frozen=True)
class Quantity:
    """Type annotation of a float in SI that a scenario may write with a unit.

    ``Annotated[float, Quantity("a damping", "N*s/m")]``.

    Attributes:
        name: what it is, with its article, for messages.
        unit: SI unit; empty for a plain number.
        above: exclusive lower bound, if any.
        least: inclusive lower bound, if any.
        exact: radians count: per Hz is not per rad/s.

    Angles, their rates and frequencies must have exactly the angle power of ``unit``; elsewhere
    radians are ignored, so that N*m*s and N*m*s/rad are the same.
    """

    name: str
    unit: str
    above: float | None = None
    least: float | None = None
    exact: bool = False

    def __get_pydantic_core_schema__(self, _: Any, __: GetCoreSchemaHandler) -> CoreSchema:
        return core_schema.no_info_plain_validator_function(self.read)

    def read(self, value: Any) -> float:
        """The value in SI; a PydanticCustomError says what was expected and what came."""
        number = self._number(value)
        if not math.isfinite(number):
            raise self._error(value, "not a finite number")
        if abs(number) > LARGEST:
            raise self._error(value, "too large to be computed with")
        if self.above is not None and number <= self.above:
            raise self._error(value, f"must be above {self.above:g}")
        if self.above is not None and 0.0 < number < 1.0 / LARGEST:
            raise self._error(value, "too small to be divided by")
        if self.least is not None and number < self.least:
            raise self._error(value, f"must be at least {self.least:g}")
        return number

    def _number(self, value: Any) -> float:
        if isinstance(value, str):
            return self._from_text(value)
        if isinstance(value, bool) or not isinstance(value, numbers.Real):
            raise self._error(value)
        try:
            return float(value)
        except OverflowError:
            return math.inf

    def _from_text(self, text: str) -> float:
        stripped = text.strip()
        match = _NUMBER.match(stripped)
        if match is None:
            raise self._error(text)
        number, unit = float(match[0]), stripped[match.end() :].strip()
        if unit.startswith("*") and not unit.startswith("**"):
            unit = unit[1:].strip()
        if not unit:
            return number
        try:
            factor, powers = _unit(unit)
        except ValueError as error:
            raise self._error(text, str(error)) from None
        expected = _unit(self.unit)[1]
        angular = "[angle]" in expected and set(expected) <= {"[angle]", "[time]"}
        if powers == expected:
            return number * factor
        strict = angular or self.exact or self.unit in ("", "Hz")
        if not strict and _without_angle(powers) == _without_angle(expected):
            return number * factor
        raise self._error(text, self._guess(expected, powers))

    def _guess(self, expected: Powers, powers: Powers) -> str:
        """What a quantity of the wrong dimension may have been."""
        names = [name for name, unit in _KNOWN.items() if _unit(unit)[1] == powers]
        forced = {name: powers.get(name, 0) + power for name, power in _unit("m/s^2")[1].items()}
        if _nonzero(powers | forced) == _nonzero(_without_angle(expected)):
            return "a mass where a force belongs? write N, kgf, lbf or ozf"
        if "[angle]" in expected and _without_angle(expected) == powers:
            units = "rpm, rev/s, deg/s or rad/s" if self.unit == "rad/s" else self.unit
            return f"turns or radians? write {units}"
        if self.unit == "Hz" and _without_angle(powers) == expected:
            return "an angular velocity? frequencies are in Hz"
        return f"{names[0]}?" if names else "another dimension"

    def _error(self, value: Any, why: str = "") -> PydanticCustomError:
        # a name may end in a comma, for the unit to follow
        what = f"{self.name} in {self.unit}" if self.unit else self.name.removesuffix(",")
        return expected(what, value, why)


def whole_number(text: str) -> bool:
    """Whether a text is a number that int() reads: digits, not superscripts, nor thousands."""
    return text.isdecimal() and len(text) < 19


def expected(what: str, value: Any, why: str = "") -> PydanticCustomError:
    """The error "expected `what`, got `value` (why)"."""
    text = f"expected {what}, got {shown(value)}" + (f" ({why})" if why else "")
    return PydanticCustomError("scenario", "{text}", {"text": text})
