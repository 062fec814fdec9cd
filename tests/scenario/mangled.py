"""Scenario texts mangled as hands, editors and other programs mangle them; seeded.

``python tests/scenario/mangled.py COUNT [SEED]`` reads so many and prints what went wrong.
"""

import copy
import random
import re
import sys
import time
import traceback
import warnings
from collections.abc import Iterator
from typing import Any

import numpy as np

from quietbus.scenario import (
    Scenario,
    ScenarioError,
    builtin_names,
    builtin_text,
    load_scenario,
)

VALUES = (
    *("0", "-1", "1e308", "-1e308", "1e-320", ".inf", ".nan", "1e400", "9" * 400, "0x10", "1_000"),
    *("1e9", "1000000000", "null", "~", "true", "no", "''", '""', "x", "[]", "{}", "[[]]", "- 1"),
    *(
        "1 kg",
        "1 rad",
        "1 s",
        "5 %",
        "-0.0",
        "2001-01-01",
        "12:30:45",
        "1,5",
        "1 5",
        "NaN",
        "=",
        "<<",
    ),
    *("[1, 2, 3]", "[1, 2, 3, 4, 5, 6]", "{a: 1}", "&a 1", "*a", "!!str 1", "!!float 1", "!x 1"),
    *("|", ">", "'", '"', "@", "`", "%", "#", "\\", "? ", ": ", "---", "...", "\u2028", "\x85"),
    *("\u202e", "\ufeff", "é", "１", "²", "10^9^9", "1 m^99", "1 (((m", "1 ***", "none", "steady"),
    *("random", "isolated", "cmg", "wheel", "step", "constant", '"\\0"', '"\\e"', '"\\ud800"'),
)
TOKEN = re.compile(r"[\w.+-]+|[\[\]{},:#&*!|>'\"-]")


def mangled(seed: int) -> str:
    """A built-in scenario's text with one to four mutations."""
    chance = random.Random(seed)
    text = builtin_text(chance.choice(builtin_names()))
    # comments would take most of the mutations
    text = re.sub(r"(?m)\s*#.*$", "", text) if chance.random() < 0.9 else text
    for _ in range(chance.randint(1, 4)):
        text = chance.choice(MUTATIONS)(text, chance)
    return text


def _lines(text: str, chance: random.Random) -> tuple[list[str], int]:
    lines = text.split("\n")
    return lines, chance.randrange(len(lines))


def delete_line(text: str, chance: random.Random) -> str:
    lines, i = _lines(text, chance)
    return "\n".join(lines[:i] + lines[i + 1 :])


def repeat_line(text: str, chance: random.Random) -> str:
    lines, i = _lines(text, chance)
    return "\n".join([*lines[: i + 1], *lines[i : i + chance.randint(1, 5)], *lines[i + 1 :]])


def swap_lines(text: str, chance: random.Random) -> str:
    lines, i = _lines(text, chance)
    j = chance.randrange(len(lines))
    lines[i], lines[j] = lines[j], lines[i]
    return "\n".join(lines)


def indent_line(text: str, chance: random.Random) -> str:
    lines, i = _lines(text, chance)
    lines[i] = chance.choice([" ", "  ", "\t", "- "]) + lines[i]
    return "\n".join(lines)


def dedent_line(text: str, chance: random.Random) -> str:
    lines, i = _lines(text, chance)
    lines[i] = lines[i].lstrip()
    return "\n".join(lines)


def swap_tokens(text: str, chance: random.Random) -> str:
    places = [match.span() for match in TOKEN.finditer(text)]
    if len(places) < 2:
        return text
    (a, b), (c, d) = sorted(chance.sample(places, 2))
    return text[:a] + text[c:d] + text[b:c] + text[a:b] + text[d:]


def replace_value(text: str, chance: random.Random) -> str:
    """What stands behind a colon, a comma or a bracket."""
    places = [match.span(1) for match in re.finditer(r"[:,\[]\s*([\w.+-][^,\]\}\n]*)", text)]
    if not places:
        return text
    a, b = chance.choice(places)
    return text[:a] + chance.choice(VALUES) + text[b:]


def replace_token(text: str, chance: random.Random) -> str:
    places = [match.span() for match in TOKEN.finditer(text)]
    if not places:
        return text
    a, b = chance.choice(places)
    return text[:a] + chance.choice(VALUES) + text[b:]


def cut(text: str, chance: random.Random) -> str:
    return text[: chance.randrange(len(text) + 1)]


def change_letter(text: str, chance: random.Random) -> str:
    i = chance.randrange(len(text) + 1)
    letter = chance.choice(
        ["\0", "\x1b", "\x85", "\u202e", "\r", "'", '"', "{", "}", "[", "]", ":"]
    )
    return text[:i] + letter + text[i + chance.randint(0, 1) :]


def number_to_text(text: str, chance: random.Random) -> str:
    places = [match.span() for match in re.finditer(r"[\d.]+(?:e-?\d+)?", text)]
    if not places:
        return text
    a, b = chance.choice(places)
    return (
        text[:a] + f"{float(chance.uniform(-1, 1)) * 10 ** chance.randint(-320, 308)!r}" + text[b:]
    )


MUTATIONS = (
    *(delete_line, repeat_line, swap_lines, indent_line, dedent_line, swap_tokens),
    *(replace_value, replace_value, replace_value, replace_token, cut, change_letter),
    *(number_to_text, number_to_text),
)


# what the built-in ones leave out
FURTHER: dict[str, Any] = {
    "lines_of_sight": {"camera": {"direction": [0, 0, 1]}, "m": {"sensitivity": [[1.0] * 12]}},
    "requirements": [
        "RPE(camera, window = 20 ms, confidence = 0.997) <= 0.04 arcsec",
        {"metric": "rms", "line_of_sight": "m", "above": 1, "at_most": "1 arcsec", "component": 0},
        {"metric": "PDE", "line_of_sight": "m", "window": 1, "tau": 2, "at_most": 1, "end": 5},
        "MTF_loss(camera, window = 20 ms, spatial_frequency = 5 1/arcsec) <= 1 %",
    ],
    "loads": [
        {"body": "bus", "force": [1, 0, 0], "profile": {"step": {"start": 1, "end": 2}}},
        {
            "body": "plate",
            "torque": [1, 0, 0],
            "profile": {"half_sine": {"start": 1, "duration": 2}},
        },
        {
            "body": "bus",
            "frame": "inertial",
            "profile": {"table": {"times": [0, 1], "values": [0, 1]}},
        },
    ],
}
DISTURBANCE: dict[str, Any] = {
    "orders": [
        {"order": 1, "radial_force": 1e-7, "phase": "random"},
        {"order": 2, "radial_torque": 1e-8, "whirl": "backward", "phase": {"radial_torque": 1}},
    ],
    "resonances": {"radial": {"frequency": "80 Hz", "damping": 0.02}},
    "broadband": {"radial_force": {"frequency": [1, 100], "psd": [1e-8, 1e-8]}},
    "seed": 3,
}
MOTOR: dict[str, Any] = {
    "ripple": [{"per_turn": 300, "torque": 1e-4}],
    "stepping": {"steps_per_turn": 200, "frequency": 20, "damping": 0.3},
}
RUN_UP = {"initial_speed": 10, "duration": 5, "shape": "linear"}
ODD = (
    *(
        None,
        True,
        False,
        0,
        -1,
        1,
        4,
        1e-9,
        1e9,
        1e308,
        5e-324,
        float("nan"),
        float("inf"),
        10**400,
    ),
    *("", "x", "none", "steady", "random", "1 kg", "2 m", "3 rad/s", "4 Hz", "5 s", "\0", "a\x1b"),
    *([], {}, [[]], [0, 0, 0], [0, 0, 1], [1, 2, 3, 4], [[0] * 3] * 3, {"a": 1}, {1: 2}, {None: 1}),
    *((), (1, 2, 3), b"x", 1j, {1}, object(), np.float64(2.0), np.zeros(3), np.eye(3), np.nan),
)


def mangled_data(seed: int) -> dict[str, Any]:
    """A scenario's data, all optional parts among them, with one to three odd values."""
    chance = random.Random(seed)
    data = load_scenario(chance.choice(builtin_names())).to_dict() | copy.deepcopy(FURTHER)
    rotor = data["cluster"]["rotor"]
    rotor["disturbance"] = copy.deepcopy(DISTURBANCE)
    if data["cluster"]["type"] == "cmg":
        data["cluster"]["gimbal_motor"] = copy.deepcopy(MOTOR)
    if chance.random() < 0.3:
        data["control"], data["cluster"]["run_up"] = "none", dict(RUN_UP)
    chance.choice([_as_it_is, _of_blocks, _of_platforms, _with_payload])(data)
    for _ in range(chance.randint(1, 3)):
        places = list(_places(data))
        within, key = chance.choice(places)
        match chance.randrange(5):
            case 0:
                del within[key]
            case 1:
                other, its_key = chance.choice(places)
                within[key] = copy.deepcopy(other[its_key])
            case 2 if isinstance(within[key], float):
                within[key] *= chance.choice([-1.0, 0.0, 1e-3, 1e3, 1e12, 1e-12])
            case _:
                within[key] = chance.choice(ODD)
    return data


def _as_it_is(data: dict[str, Any]) -> None:
    """One platform with one block of units."""


def _of_blocks(data: dict[str, Any]) -> None:
    """CMGs and wheels on one plate."""
    wheels = load_scenario("wheels-demo").to_dict()["cluster"]
    data["cluster"] = [data["cluster"], wheels]


def _of_platforms(data: dict[str, Any]) -> None:
    """One platform on another."""
    parts = {key: data.pop(key) for key in ("isolator", "cluster")}
    above = copy.deepcopy(parts) | {"name": "above", "on": "plate"}
    data["platforms"] = [above, parts | {"name": "plate"}]


def _with_payload(data: dict[str, Any]) -> None:
    """A bench with the lines of sight."""
    isolator = copy.deepcopy(data["isolator"])
    data["payload"] = {"body": isolator.pop("plate"), "isolator": isolator}


def _places(data: Any) -> Iterator[tuple[Any, Any]]:
    """All containers with each of their keys."""
    for key in range(len(data)) if isinstance(data, list) else list(data):
        yield data, key
        if isinstance(data[key], dict | list):
            yield from _places(data[key])


def fault(given: str | dict[str, Any], most_s: float = 2.0) -> str | None:
    """What is wrong with how a text or data are read, or None: a scenario, or refused."""
    start = time.process_time()
    try:
        # a warning of a library is none that a user could understand
        warnings.simplefilter("error")
        read = Scenario.from_yaml if isinstance(given, str) else Scenario.from_dict
        scenario = read(given, "s.yaml")
        if Scenario.from_yaml(scenario.to_yaml()) != scenario:
            return "is another one when written and read again"
    except ScenarioError as error:
        told = str(error)
        if not told.isprintable() and any(not line.isprintable() for line in told.split("\n")):
            return f"control letters in {told!r}"
        if ("\n" in told and max(map(len, told.split("\n"))) > 600) or len(told) > 20_000:
            return f"{len(told)} letters of message"
        jargon = re.search(r"pydantic|Input |np\.|numpy|<class|object at|should be a valid", told)
        if jargon:
            return f"jargon: {told}"
    except Exception:
        return traceback.format_exc(limit=-4)
    took = time.process_time() - start
    return f"took {took:.1f} s" if took > most_s else None


def faults(count: int, first: int = 0) -> Iterator[tuple[int, str]]:
    """Seeds and faults of so many mangled texts."""
    for seed in range(first, first + count):
        for made in (mangled, mangled_data):
            found = fault(made(seed))
            if found:
                yield seed, found


if __name__ == "__main__":
    for seed, found in faults(*(int(argument) for argument in sys.argv[1:])):
        print(f"--- {seed}: {found}", flush=True)
