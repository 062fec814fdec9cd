"""Reading takes a time linear in the length of a text, whatever the text is."""

import ast
import importlib
import re
import time
from pathlib import Path

import pytest
from pydantic_core import PydanticCustomError

import quietbus
from quietbus.scenario import Scenario, ScenarioError, builtin_text
from quietbus.scenario.units import Quantity

SOURCE = Path(quietbus.__file__).parent
LENGTHS = (14, 18, 22, 26, 60, 300, 1500, 10_000)  # the first ones stop an exponential early
MOST = 0.05  # [s] of processor time
TAKING = {"compile", "match", "fullmatch", "search", "sub", "subn", "split", "findall", "finditer"}
PIECES = ["a", "N", "m", "1", "e", " ", "\t", ".", "-", "+", "*", "^", "(", ")", "[", ",", "=", "/"]
ENDS = ["", "?", "\n", "\x00", "1", "a"]


def patterns() -> list[tuple[str, re.Pattern[str]]]:
    """Every regular expression of the source, with the place where it stands."""
    found = []
    for file in sorted(SOURCE.rglob("*.py")):
        for node in ast.walk(ast.parse(file.read_text(encoding="utf-8"))):
            if (
                isinstance(node, ast.Call)
                and isinstance(node.func, ast.Attribute)
                and isinstance(node.func.value, ast.Name)
                and node.func.value.id == "re"
                and node.func.attr in TAKING
            ):
                place = ".".join(file.relative_to(SOURCE.parent).with_suffix("").parts)
                module = importlib.import_module(place.removesuffix(".__init__"))
                expression = compile(ast.Expression(node.args[0]), str(file), "eval")
                flags = [ast.unparse(arg) for arg in (*node.args[1:], *node.keywords)]
                ignore = re.IGNORECASE if any("IGNORECASE" in flag for flag in flags) else 0
                pattern = eval(expression, vars(module))  # its text may be put together
                found.append((f"{place}:{node.lineno}", re.compile(pattern, ignore)))
    return found


def hostile(pattern: re.Pattern[str], n: int):
    """Texts of some n characters: pieces over and over, behind the pattern's own words too."""
    words = re.sub(r"\\[a-zA-Z]", "", pattern.pattern)
    letters = sorted(set(re.findall(r"[\w(),<=]", words)))[:12]
    for piece in dict.fromkeys([*PIECES, *letters, "a ", "1 ", "m*", "^1", "a=1,", ",a=1", ") ("]):
        body = piece * (n // len(piece))
        for end in ENDS:
            yield body + end
        for start in ("1", "1 a", "a(", "a(b", "a(b,c=1", "a(b)<="):
            yield start + body + "?\n"


def processor_time(action) -> float:
    """[s] of the fastest of some runs: a busy machine pauses in the middle of one."""
    least = float("inf")
    for _ in range(6):
        start = time.process_time()
        action()
        least = min(least, time.process_time() - start)
        if least < MOST:
            break
    return least


def slowest(pattern: re.Pattern[str]) -> tuple[float, str]:
    """Time and beginning of the first text that takes too long, or of the slowest."""
    worst = (0.0, "")
    for n in LENGTHS:
        for text in hostile(pattern, n):
            for use in (pattern.match, pattern.fullmatch, pattern.search):
                taken = processor_time(lambda use=use, text=text: use(text))
                worst = max(worst, (taken, f"{text[:12]!r}, {n} characters"))
                if taken > MOST:
                    return worst
    return worst


@pytest.mark.parametrize(("place", "pattern"), [pytest.param(*p, id=p[0]) for p in patterns()])
def test_every_pattern_of_the_source_is_linear(place, pattern):
    taken, text = slowest(pattern)
    assert taken < MOST, f"{place}: {pattern.pattern} takes {taken:.2g} s of {text}"


@pytest.mark.parametrize(
    "pattern",
    [
        r"(?:[^\W\d]+|[*/\s])*",  # exponential
        r"\s*(\w+)\s*\(\s*([^=,()]+?)\s*((?:,[^,=]+=[^,=]+)*)\)\s*<=\s*(.+?)\s*",  # cubic
        r"\d+x",  # quadratic, where it is searched for
    ],
)
def test_the_search_for_slow_patterns_finds_them(pattern):
    assert slowest(re.compile(pattern))[0] > MOST


@pytest.mark.parametrize(
    "text",
    [
        "3 " + "twenty kilonewtons by the metre " * 2 + "?",
        "3 " + "word " * 2000 + "?",
        "3 " + "w" * 55 + "?",
        "1" * 10_000 + "x",
        "1" + " " * 10_000 + "?",
        "1 m" + "^2 " * 3000,
        "-" * 10_000,
        "3 " + "a-" * 5000,
    ],
)
def test_a_number_with_words_is_refused_at_once(text):
    def read():
        with pytest.raises(PydanticCustomError, match="expected a mass"):
            Quantity("a mass", "kg").read(text)

    read()
    assert processor_time(read) < MOST


@pytest.mark.parametrize(
    "text",
    [
        "RPE(" + "camera " * 1400,
        "RPE(camera" + ", a = 1" * 1400,
        "RPE(camera" + ",a=1" * 2500 + ") <= 1",
        "RPE(camera) <= 1 arcsec" + " " * 10_000 + "?",
        "RPE(camera" + " " * 10_000 + ")",
    ],
)
def test_a_requirement_that_is_none_is_refused_at_once(text):
    data = Scenario.from_yaml(builtin_text("zhang2012")).to_dict()
    data |= {"lines_of_sight": {"camera": {"direction": [0, 0, 1]}}, "requirements": [text]}

    def read():
        with pytest.raises(ScenarioError, match=r"requirements\[0\]"):
            Scenario.from_dict(data)

    read()
    assert processor_time(read) < 4 * MOST  # the rest of the scenario is read too


def test_digits_that_are_no_number_are_not_read_as_one():
    scenario = Scenario.from_yaml(builtin_text("zhang2012"))
    for path in ("cluster.units.²", "cluster.units." + "9" * 5000):
        with pytest.raises(ScenarioError):
            scenario.with_overrides({path: 1.0})
