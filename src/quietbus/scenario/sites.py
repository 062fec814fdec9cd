"""What stands on the bus, told in one way whatever short form the file used."""

from __future__ import annotations

import dataclasses

from quietbus.scenario.hardware import Cluster, Isolator
from quietbus.scenario.wheels import WheelCluster


@dataclasses.dataclass(frozen=True)
class Site:
    """An upper plate on its isolator, with the blocks of CMGs or wheels that it carries."""

    name: str
    isolator: Isolator
    blocks: tuple[Cluster | WheelCluster, ...]
