"""What the commands take: options, and the scenario with their values in place of its own."""

from __future__ import annotations

import itertools
import sys
from enum import StrEnum
from pathlib import Path
from typing import TYPE_CHECKING, Annotated, Any, ClassVar

import typer

from quietbus.cli.guard import BadInput

if TYPE_CHECKING:
    from quietbus import methods
    from quietbus.scenario import Scenario, ScenarioError

OUT = Path("out")  # folder of the results, unless another is given


class Mount(StrEnum):
    """How the upper plate is held."""

    isolated = "isolated"
    rigid = "rigid"


class Method(StrEnum):
    """How the motion is computed."""

    direct = "direct"
    harmonic = "harmonic"


def method_object(word: Method) -> methods.Method:
    """The method that the word on the command line means."""
    from quietbus.methods import as_method  # here, so that --help need not load it

    return as_method(word.value)


ScenarioArgument = Annotated[
    str, typer.Argument(metavar="SCENARIO", help="A scenario file, or a built-in's name.")
]


DurationOption = Annotated[
    str | None, typer.Option(help="Length of the run in s (or '2 min'), instead of the scenario's.")
]


AnglesOption = Annotated[
    str | None,
    typer.Option(help="'30 deg, -30 deg, ...' (or rad) of all CMGs, instead of the scenario's."),
]


FolderOption = Annotated[Path, typer.Option("-o", "--output", help="Folder for the results.")]
JsonOption = Annotated[
    bool, typer.Option("--json", help="Print one JSON object and nothing else; no pictures.")
]


class Asked:
    """The scenario in work, so that what is found wrong with it later is told of its file too."""

    file: str = ""
    names: tuple[str, ...] = ()  # under which it tells of its problems
    options: ClassVar[dict[str, str]] = {}  # of the command line, by the path that each has set

    @classmethod
    def told(cls, error: ScenarioError) -> ScenarioError:
        """With the file and its lines, or with the options in whose values the fault lies."""
        from quietbus.scenario import ScenarioError, located
        from quietbus.scenario.errors import dotted

        if error.source not in cls.names:
            return error
        by_option = dict.fromkeys(
            option
            for path, option in cls.options.items()
            if any(dotted(problem.path).startswith(path) for problem in error.problems)
        )
        if by_option:
            return ScenarioError(f"{cls.file} with {', '.join(by_option)}", error.problems)
        return located(error, cls.file)


def load(
    name: str,
    mount: Mount | None,
    duration: str | None,
    output_rate: str | None = None,
    gimbal_angles: str | None = None,
) -> Scenario:
    """The scenario with the command line's values instead of its own; what is odd in it is told."""
    from quietbus.scenario import load_scenario
    from quietbus.scenario.plausibility import implausible

    given: dict[str, tuple[str, Any]] = {
        "simulation.duration": ("--duration", duration),
        "simulation.output_rate": ("--output-rate", output_rate),
    }
    given = {path: said for path, said in given.items() if said[1] is not None}
    scenario = load_scenario(name)
    if gimbal_angles is not None:
        angles = [angle.strip() for angle in gimbal_angles.split(",")]
        for path, own in _of_blocks(scenario, angles).items():
            given[path] = ("--gimbal-angles", own)
    Asked.file, Asked.names = name, (scenario.name, f"{scenario.name} with overrides")
    Asked.options = {path: option for path, (option, _) in given.items()}
    scenario = scenario.with_overrides({path: value for path, (_, value) in given.items()})
    if mount is not None:
        scenario = scenario.with_mount(mount.value)
    for note in implausible(scenario):
        print(f"note: {note}", file=sys.stderr)
    return scenario


def _of_blocks(scenario: Scenario, angles: list[str]) -> dict[str, list[str]]:
    """Angles of all CMGs, through all platforms and blocks in their order, by path."""
    from quietbus.scenario.blocks import Blocks

    blocks = [
        (f"{path}.gimbal_angles", block.count)
        for site in scenario.sites
        for path, block in site.blocks_at
        if Blocks((block,)).gimbals_turn
    ]
    if not blocks:
        raise BadInput("--gimbal-angles: expected none, since no unit has a gimbal")
    if len(blocks) == 1:
        return {blocks[0][0]: angles}
    count = sum(own for _, own in blocks)
    if len(angles) != count:
        each = ", ".join(f"{own} of {path.removesuffix('.gimbal_angles')}" for path, own in blocks)
        raise BadInput(
            f"--gimbal-angles: expected {count} angles, one for each CMG ({each}), "
            f"got {len(angles)}"
        )
    ends = itertools.accumulate(own for _, own in blocks)
    return {path: angles[end - own : end] for (path, own), end in zip(blocks, ends, strict=True)}


def speed(text: str) -> float:
    """A positive angular velocity [rad/s]."""
    from pydantic_core import PydanticCustomError

    from quietbus.scenario.plausibility import unlikely_speed
    from quietbus.scenario.units import Quantity

    try:
        read = Quantity("an angular velocity", "rad/s", above=0.0).read(text)
    except PydanticCustomError as error:
        raise BadInput(f"--max-speed: {error}") from None
    note = unlikely_speed(read)
    if note:
        print(f"note: --max-speed: read as {note}", file=sys.stderr)
    return read
