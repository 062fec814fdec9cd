"""What the commands take: options, and the scenario with their values in place of its own."""

from __future__ import annotations

import sys
from enum import StrEnum
from pathlib import Path
from typing import TYPE_CHECKING, Annotated, ClassVar

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
    typer.Option(help="'30 deg, -30 deg, ...' (or rad), instead of the scenario's."),
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
        by_option = [
            option
            for path, option in cls.options.items()
            if any(dotted(problem.path).startswith(path) for problem in error.problems)
        ]
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

    angles = gimbal_angles and [angle.strip() for angle in gimbal_angles.split(",")]
    given = {
        "simulation.duration": ("--duration", duration),
        "simulation.output_rate": ("--output-rate", output_rate),
        "cluster.gimbal_angles": ("--gimbal-angles", angles),
    }
    given = {path: said for path, said in given.items() if said[1] is not None}
    scenario = load_scenario(name)
    Asked.file, Asked.names = name, (scenario.name, f"{scenario.name} with overrides")
    Asked.options = {path: option for path, (option, _) in given.items()}
    scenario = scenario.with_overrides({path: value for path, (_, value) in given.items()})
    if mount is not None:
        scenario = scenario.with_mount(mount.value)
    for note in implausible(scenario):
        print(f"note: {note}", file=sys.stderr)
    return scenario


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
