"""Checks of actuators of users' own kinds."""

from typing import Any

import jax
import jax.numpy as jnp
import numpy as np

from quietbus.build.own import Asked, number, told_at
from quietbus.dynamics.linearize import input_rows
from quietbus.model.element import (
    AbstractActuator,
    Around,
    Authority,
    Driven,
    Energy,
    Own,
    Rates,
    RigidParts,
)
from quietbus.model.motion import Motion
from quietbus.model.report import Output
from quietbus.model.satellite import Satellite
from quietbus.programs import compiled_for_few_runs
from quietbus.scenario import Scenario
from quietbus.words import shown


def check_actuator(actuator: AbstractActuator, name: str, bodies: tuple[str, ...]) -> None:
    """Refuse an actuator with another name, hosts that are no bodies, or methods of wrong shapes.

    Raises:
        LawError: the first that is wrong.
    """
    asked = Asked(actuator)
    asked.fields()
    if actuator.name != name:
        raise asked.wrong("name", f"{name!r}, as its builder is given", shown(actuator.name))
    hosts = actuator.hosts
    if not (isinstance(hosts, tuple) and hosts and set(hosts) <= set(bodies)):
        raise asked.wrong("hosts", f"a tuple of some of {', '.join(bodies)}", shown(hosts))
    asked.call("nameless")
    around = Around(number(), number(3, 3), (_motion(),) * len(hosts), _own(asked))
    commands = len(asked.names("command_names", str))
    _check_motion(asked, around, commands)
    if commands:
        _check_authority(asked, around, commands)


def _own(asked: Asked) -> Own:
    """Shapes of its own part of the state."""
    own = asked.gives_fields("start", (), Own, "in a row", q=(None,), y=(None,), z=(None,))
    for key, rate in (("q", "u"), ("y", "y_rate")):
        asked.fits(f"start().{rate}", getattr(own, rate), getattr(own, key).shape, f"as {key} has")
    asked.names("driven_names", Driven, len(own.y))
    return own


def _motion() -> Motion:
    return Motion(number(3, 3), number(3), number(3), number(3))


def _check_motion(asked: Asked, around: Around, commands: int) -> None:
    """What every element gives."""
    own, hosts = around.own, len(around.hosts)
    n = 6 * hosts + len(own.u)
    speeds = f"6 speeds of each of {hosts} hosts and {len(own.u)} of its own"
    moving = (around, Rates(own.y, own.z), number(n))
    command = number(commands or len(own.y))  # idle where there is none
    asked.gives("mass", (around,), (n, n), speeds)
    asked.gives_fields(
        "rates", (around, command), Rates, "as start has it", y=own.y.shape, z=own.z.shape
    )
    asked.gives("balance", moving, (n,), speeds)
    asked.slopes("rates", around, command)
    asked.slopes("balance", *moving)
    asked.gives("answer", moving, (3, n, len(own.y)), "derivatives of balance")
    asked.gives("configuration", (around,), (None,), "in a row")
    asked.gives("margin", (around,), ())
    asked.gives("corners", (), (None,), "in a row")
    asked.gives_fields("energy", (around,), Energy, stored=(), dissipated=())
    parts = asked.gives_fields("rigid_parts", (around,), RigidParts, "in a row", mass=(None,))
    vectors = dict.fromkeys(("p", "v", "w"), (len(parts.mass), 3))
    inertia = (len(parts.mass), 3, 3)
    asked.gives_fields(
        "rigid_parts", (around,), RigidParts, "one for each mass", I=inertia, **vectors
    )
    asked.shapes("report", *moving, of=_values)


def _values(told: Any) -> list[Any]:
    """Values of a report, which has to be one."""
    if not isinstance(told, tuple) or not all(isinstance(each, Output) for each in told):
        raise TypeError(f"expected a tuple of Output, got {shown(told)}")
    for quantity, value in told:
        if jnp.ndim(value) != len(quantity.dimensions):
            over = ", ".join(quantity.dimensions) or "nothing"
            got = jnp.shape(value)
            raise TypeError(f"{quantity.name}: expected numbers over {over}, got shape {got}")
    return [output.value for output in told]


def _check_authority(asked: Asked, around: Around, n: int) -> None:
    """What commands do, of which there are n."""
    why = f"one for each of {n} command_names"
    asked.gives_fields("authority", (around,), Authority, why, axes_A=(3, n), torque=(), full=(n,))
    asked.gives("share", (number(n),), ())
    asked.gives("possible", (around, number(n)), (n,), why)


def check_at_start(scenario: Scenario, satellite: Satellite) -> None:
    """Refuse actuators whose commands are called as another's, or whose values make no sense.

    Raises:
        ScenarioError: the first that is wrong.
    """
    if not scenario.actuators:
        return
    own = {each.name: each for each in satellite.others if each.name in scenario.actuators}
    owner: dict[str, str] = {}
    rows, nominal = input_rows(satellite), satellite.nominal()
    for (_, whose), names in zip(rows.keys, rows.names, strict=True):
        for name in names:
            if name in owner and whose in own:
                with told_at(scenario, ("actuators", whose)):
                    what = f"{name!r}, which {owner[name]} has already"
                    raise Asked(own[whose]).wrong("command_names", "names of their own", what)
            owner[name] = whose
    for name, actuator in own.items():
        with told_at(scenario, ("actuators", name)):
            _check_numbers(Asked(actuator), _numbers(actuator, nominal))


def _check_numbers(asked: Asked, numbers: dict[str, Any]) -> None:
    for name in ("rates", "mass", "balance", "energy", "authority"):
        asked.finite(name, numbers.get(name))
        asked.finite(name, numbers.get(f"{name} slopes"), "derivatives")
    if "authority" not in numbers:
        return
    for key in ("torque", "full"):
        value = np.asarray(getattr(numbers["authority"], key))
        if np.any(value <= 0.0):
            raise asked.wrong(f"authority().{key}", "what is above 0", shown(value))
    share = float(numbers["share"])
    if not 0.0 < share <= 1.0:
        raise asked.wrong("share", "a number above 0, up to 1, for commands of 0", f"{share:g}")


@compiled_for_few_runs
def _numbers(actuator, nominal):
    hosts, own = tuple(nominal[host] for host in actuator.hosts), actuator.start()
    around, n = Around(jnp.zeros(()), jnp.eye(3), hosts, own), actuator.commands
    asked = (around, jnp.zeros(n or len(own.y)))
    rates = actuator.rates(*asked)
    moving = (around, rates, jnp.zeros(6 * len(hosts) + len(own.u)))
    numbers = {
        "mass": actuator.mass(around),
        "rates": rates,
        "balance": actuator.balance(*moving),
        "rates slopes": jax.jacfwd(actuator.rates, argnums=(0, 1))(*asked),
        "balance slopes": jax.jacfwd(actuator.balance, argnums=(0, 1, 2))(*moving),
        "energy": actuator.energy(around),
    }
    if not n:
        return numbers
    share = actuator.share(jnp.zeros(n))
    return numbers | {"authority": actuator.authority(around), "share": share}
