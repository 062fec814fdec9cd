"""What a run holds: names, dimensions, units and meanings of its variables.

The parts of the satellite declare what they report (``model.report``); here are the tables of it.
"""

from collections.abc import Iterable, Mapping

from quietbus.dynamics import views
from quietbus.model import cluster, control
from quietbus.model.body import body_quantities
from quietbus.model.legs import hexapod
from quietbus.model.report import Quantity

AXES = ("x", "y", "z")
PAIRS = ("yz", "zx", "xy")
DIMENSIONS = {
    "axis": ("axis", list(AXES), "component"),
    "quaternion": ("quaternion", ["w", "x", "y", "z"], "component, scalar first"),
}
Table = dict[str, tuple[tuple[str, ...], str, str]]  # name: (dimensions, unit, meaning)

_BODIES = ("bus", "plate")
_PARTS = (
    *(quantity for name in _BODIES for quantity in body_quantities(name).values()),
    *cluster.QUANTITIES,
    *hexapod.QUANTITIES,
    *control.QUANTITIES,
)


def _table(quantities: Iterable[Quantity]) -> Table:
    return {q.name: (q.dimensions, q.unit, q.meaning) for q in quantities}


def _deviation(quantity: Quantity) -> tuple[tuple[str, ...], str, str]:
    """Of an attitude: its deviations are rotation vectors."""
    return ("axis",), "rad", quantity.of_vibration


# dimensions after time
VARIABLES = _table(q for q in _PARTS if not q.when)
CONTROL_VARIABLES = _table([control.SHARE])  # of runs in which the control makes units act
CHANGING_VARIABLES = _table([cluster.ROTOR_TORQUE])  # of runs whose rotor speeds change
JOINT_VARIABLES = _table(q for q in hexapod.QUANTITIES if q.when)
WORST_PHASES = "worst_phases_rate"  # of runs that a command has written
# of harmonic runs; dimensions of a component
JITTER_VARIABLES: Table = {
    q.name: ((q.dimensions, q.unit, q.meaning) if not q.of_vibration else _deviation(q))
    for q in (*_PARTS, *views.QUANTITIES)
    if q.vibrates
}
_OF_PLATE = {quantity.name for quantity in body_quantities("plate").values()}
COMBINED = {
    "envelope": "largest value as lines beat, phases as given",
    "worst_case": "sum of all amplitudes, any phases",
    "rss": "root of the sum of squares of all amplitudes",
    "rms": "root mean square over the second about the instant, phases as given",
}


def variables_of(bodies: Iterable[str]) -> Table:
    """Those that every run of a satellite of these bodies has."""
    own = (quantity for body in bodies for quantity in body_quantities(body).values())
    return {name: row for name, row in VARIABLES.items() if name not in _OF_PLATE} | _table(own)


def jitter_variables_of(bodies: Iterable[str]) -> Table:
    """Those whose deviations every harmonic run of these bodies has."""
    known = {name: row for name, row in JITTER_VARIABLES.items() if name not in _OF_PLATE}
    own = (quantity for body in bodies for quantity in body_quantities(body).values())
    return _table(q for q in own if q.vibrates) | known


def rate_of(body: str) -> str:
    """Name of a body's angular velocity."""
    return body_quantities(body)["rate"].name


def described(name: str) -> tuple[tuple[str, ...], str] | None:
    """Dimensions and unit of a variable by its name, None of one that no run has."""
    for table in (VARIABLES, CONTROL_VARIABLES, CHANGING_VARIABLES, JOINT_VARIABLES):
        if name in table:
            inner, unit, _ = table[name]
            return ("time", *inner), unit
    if name == WORST_PHASES:
        return ("axis",), "rad/s"
    if name == "jitter_change_error":
        return ("time",), "1"
    if name == "line_of_sight_change_error":
        return ("time", "line"), "rad"
    if name == "line_of_sight_cospectrum":
        return ("look", "frequency", "cmg", "line", "pair"), per_hertz("rad")
    of_body = _of_body(name)
    if of_body is not None:
        return ("time", *of_body.dimensions), of_body.unit
    for of, (inner, unit, _) in JITTER_VARIABLES.items():
        parts: dict[str, tuple[tuple[str, ...], str]] = {
            "jitter_amplitude": (("time", "cmg", "order", *inner), unit),
            "jitter_phase": (("time", "cmg", "order", *inner), "rad"),
            "ripple_amplitude": (("time", "cmg", "ripple", *inner), unit),
            "ripple_phase": (("time", "cmg", "ripple", *inner), "rad"),
            "psd": (("look", "frequency", "cmg", *inner), per_hertz(unit)),
            "noise_rms": (("time", *inner), unit),
        }
        parts |= {f"jitter_{kind}": (("time", *inner), unit) for kind in COMBINED}
        part = name.removeprefix(f"{of}_")
        if part != name and part in parts:
            return parts[part]
    return None


def told(name: str, more: Mapping[str, Quantity] | None = None) -> tuple[tuple[str, ...], str, str]:
    """Dimensions after time, unit and meaning of an output by its name.

    Args:
        more: quantities of parts of users' own kinds.
    """
    for table in (VARIABLES, CONTROL_VARIABLES, CHANGING_VARIABLES, JOINT_VARIABLES):
        if name in table:
            return table[name]
    if more and name in more:
        return _table([more[name]])[name]
    of_body = _of_body(name)
    if of_body is None:
        raise KeyError(name)
    return _table([of_body])[name]


def jitter_of(name: str) -> tuple[tuple[str, ...], str, str]:
    """Dimensions of a component, unit and meaning of an output's deviations."""
    return JITTER_VARIABLES[name] if name in JITTER_VARIABLES else told(name)


def _of_body(name: str) -> Quantity | None:
    """What a body of a name that is not known here reports, None of anything else."""
    body, _, kind = name.rpartition("_")
    return body_quantities(body).get(kind) if body else None


def per_hertz(unit: str) -> str:
    """Unit of a power spectral density."""
    return f"({unit})^2/Hz"
