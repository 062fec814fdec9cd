"""One satellite of several that share a bus, each with platforms of its own."""

from collections.abc import Sequence
from dataclasses import replace
from typing import Any

from quietbus.model.satellite import BUS, Satellite


def together(satellites: Sequence[Satellite]) -> Satellite:
    """All platforms, legs, clusters and loads on one bus, numbered where there are several.

    Bus and control are those of the first; it commands the actuators of all.
    """
    if len(satellites) == 1:
        return satellites[0]
    parts = [_numbered(satellite, i) for i, satellite in enumerate(satellites)]
    joined: dict[str, Any] = {
        name: tuple(each for part in parts for each in getattr(part, name))
        for name in ("mounts", "hexapods", "clusters", "others")
    }
    bodies = (parts[0].bus, *(body for part in parts for body in part.bodies[1:]))
    actuators = tuple(name for part in parts for name in part.control.actuators)
    control = replace(parts[0].control, actuators=actuators)
    return Satellite(bodies=bodies, control=control, **joined)


def _numbered(satellite: Satellite, i: int) -> Satellite:
    """The satellite with a number at the names of all that is not the bus."""
    new = lambda name: name if name == BUS else f"{name}{i}"  # noqa: E731

    def renamed(element: Any) -> Any:
        return replace(element, name=new(element.name), hosts=tuple(map(new, element.hosts)))

    mounts = (replace(m, body=new(m.body), base=new(m.base)) for m in satellite.mounts)
    control = satellite.control
    return Satellite(
        bodies=tuple(replace(body, name=new(body.name)) for body in satellite.bodies),
        mounts=tuple(mounts),
        hexapods=tuple(map(renamed, satellite.hexapods)),
        clusters=tuple(map(renamed, satellite.clusters)),
        others=tuple(map(renamed, satellite.others)),
        control=replace(control, actuators=tuple(map(new, control.actuators))),
    )
