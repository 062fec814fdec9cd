"""Where the parts of a scenario stand: its platforms, and the blocks of units on them."""

from collections.abc import Mapping
from dataclasses import dataclass
from typing import Any

Data = Mapping[str, Any]  # as of Scenario.to_dict: SI units, every default filled in


@dataclass(frozen=True)
class Platform:
    """A body on an isolator on the bus, with what it carries."""

    name: str  # of the body
    isolator: Data  # its ``plate`` is the body
    clusters: list[Data]


@dataclass(frozen=True)
class Block:
    """Units of one kind that a scenario describes together."""

    data: Data
    host: int  # number of the body that carries them; the bus is 0
    units: slice  # their numbers among all units of the satellite

    @property
    def wheels(self) -> bool:
        """Whether the units are reaction wheels; otherwise they are CMGs."""
        return bool(self.data["type"] == "wheel")


def platforms(data: Data) -> list[Platform]:
    """All bodies beside the bus, in their order: platforms, then the payload.

    The body of a scenario's only platform is its ``plate``, that of a payload is ``payload``.
    """
    said = data.get("platforms") or ([{**data, "name": "plate"}] if "isolator" in data else [])
    found = [Platform(each["name"], each["isolator"], _listed(each)) for each in said]
    if data.get("payload"):
        bench = data["payload"]
        isolator = {**bench["isolator"], "plate": bench["body"]}
        found.append(Platform("payload", isolator, []))
    return found


def _listed(platform: Data) -> list[Data]:
    clusters = platform.get("cluster") or []
    return clusters if isinstance(clusters, list) else [clusters]


def blocks(data: Data) -> list[Block]:
    """The blocks of all platforms; units are numbered through them."""
    found: list[Block] = []
    for host, platform in enumerate(platforms(data), start=1):
        for cluster in platform.clusters:
            first = found[-1].units.stop if found else 0
            count = cluster["pyramid"]["units"] if "pyramid" in cluster else len(cluster["units"])
            found.append(Block(cluster, host, slice(first, first + count)))
    return found
