"""What stands on the bus, told in one way whatever form the file used."""

from __future__ import annotations

import dataclasses
import re
from collections.abc import Iterable, Iterator
from typing import Annotated, Any

from pydantic import Discriminator, Tag

from quietbus.scenario.base import Name, Part, listing
from quietbus.scenario.blocks import Block
from quietbus.scenario.errors import Findings, Path, dotted
from quietbus.scenario.hardware import Isolator, Mounting, Plate
from quietbus.scenario.wheels import AnyCluster

BUS, PLATE, PAYLOAD = "bus", "plate", "payload"
# what else has a name in results and models: "gimbal_rate" is not the rate of a body
TAKEN = re.compile(r"(gimbal|platform|control|legs|cluster)|(cmg|load |cluster )\d+")

# one block of CMGs or wheels, or a list of such blocks
AnyBlocks = Annotated[
    Annotated[AnyCluster, Tag("<one>")]
    | Annotated[tuple[AnyCluster, ...], listing(None, "blocks of CMGs or wheels"), Tag("<each>")],
    Discriminator(lambda value: "<each>" if isinstance(value, list | tuple) else "<one>"),
]


class Platform(Part):
    """One of several platforms."""

    name: Name
    on: Name = BUS  # the body that it stands on
    isolator: Isolator
    cluster: AnyBlocks


class Payload(Part):
    """A bench with the line of sight, on a platform of its own."""

    name: Name = PAYLOAD
    on: Name = BUS
    body: Plate
    isolator: Mounting


@dataclasses.dataclass(frozen=True)
class Site:
    """A body on its isolator, with the blocks of CMGs or wheels that it carries."""

    name: str  # of the body
    on: str  # name of the body that it stands on
    isolator: Mounting
    plate: Plate  # mass properties of the body, without its units
    blocks: tuple[Block, ...]
    path: tuple[str | int, ...]  # in the scenario, of what it is made of
    plate_key: tuple[str, ...] = ("isolator", "plate")  # below it, of the body
    listed: bool = False  # whether the blocks are a list in the scenario

    @property
    def legs_at(self) -> str:
        """Path of the legs in words."""
        return dotted((*self.path, "isolator", "legs"))

    @property
    def strut_at(self) -> Path:
        """Path of a law of struts."""
        return (*self.path, "isolator", "legs", "strut")

    @property
    def plate_at(self) -> str:
        """Path of the body."""
        return dotted((*self.path, *self.plate_key))

    @property
    def blocks_by_path(self) -> list[tuple[Path, Block]]:
        """The blocks with their paths."""
        at = (*self.path, "cluster")
        if not self.listed:
            return [(at, block) for block in self.blocks]
        return [((*at, k), block) for k, block in enumerate(self.blocks)]

    @property
    def blocks_at(self) -> list[tuple[str, Block]]:
        """The same with the paths in words."""
        return [(dotted(path), block) for path, block in self.blocks_by_path]


def platform_site(name: str, on: str, isolator: Isolator, cluster: Any, path: Path) -> Site:
    """A platform with its units."""
    listed = isinstance(cluster, tuple)
    blocks = cluster if listed else (cluster,)
    return Site(name, on, isolator, isolator.plate, blocks, path, listed=listed)


def check_names(sites: tuple[Site, ...], findings: Findings) -> None:
    """Find names that are not unique, unknown bodies that others stand on, and loops of these."""
    names = [BUS]
    for site in sites:
        check_name(site.name, names, (*site.path, "name"), findings)
        names.append(site.name)
    if len(set(names)) < len(names):
        return
    on, told = {site.name: site.on for site in sites}, set[str]()
    for site in sites:
        if site.on not in names or site.on == site.name:
            known = ", ".join(name for name in names if name != site.name)
            findings.add((*site.path, "on"), f"expected a body, one of {known}; got {site.on!r}")
        elif site.name in _chain(site.name, on) and site.name not in told:
            told.update(_chain(site.name, on))
            loop = " on ".join([site.name, *_chain(site.name, on)])
            said = f"expected bodies that stand on the bus in the end; got a loop: {loop}"
            findings.add((*site.path, "on"), said)


def check_name(name: str, names: Iterable[str], path: Path, findings: Findings) -> None:
    """Find a body's or actuator's name that something else has."""
    what = ""
    if name == BUS:
        what = "which is the satellite's own"
    elif name in names:
        what = "which another body has already"
    elif TAKEN.fullmatch(name) or name.endswith((" legs", " cluster")):
        what = "which results and models call something else"
    elif "/" in name:
        what = "whose '/' cannot be in the name of a result"
    if what:
        findings.add(path, f"expected a name of its own, got {name!r}, {what}")


def _chain(name: str, on: dict[str, str]) -> list[str]:
    """What a body stands on, down to the bus, or to where it began."""
    chain: list[str] = []
    below = on.get(name)
    while below is not None and below not in chain:
        chain.append(below)
        if below == name:
            break
        below = on.get(below)
    return chain


def from_the_bus(sites: tuple[Site, ...]) -> Iterator[Site]:
    """The sites, each after the one that it stands on."""
    left, known = list(sites), {BUS}
    while left:
        ready = [site for site in left if site.on in known]
        yield from ready
        known |= {site.name for site in ready}
        left = [site for site in left if site not in ready]
