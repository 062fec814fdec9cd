"""The documentation: its code runs, its links lead somewhere, its tables are those of the code."""

import itertools
import json
import re
import typing
from pathlib import Path

import numpy as np
import pytest
import typer
from ruamel.yaml import YAML

import quietbus as qb
from oracles.pages import assert_rounds, assert_shown, table
from quietbus import cli
from quietbus.analysis.pointing.windows import METRICS
from quietbus.results import (
    CHANGING_VARIABLES,
    CONTROL_VARIABLES,
    JOINT_VARIABLES,
    VARIABLES,
    Summary,
)
from quietbus.scenario import builtin_names
from quietbus.scenario.base import Count, Part
from quietbus.scenario.control import LAWS
from quietbus.scenario.hardware import Unit
from quietbus.scenario.sites import Payload, Platform
from quietbus.scenario.units import Quantity
from quietbus.scenario.wheels import Wheel

ROOT = Path(__file__).parents[1]
PAGES = [
    *(ROOT / name for name in ("README.md", "CHANGELOG.md", "CONTRIBUTING.md")),
    *sorted((ROOT / "docs").rglob("*.md")),
]
FENCE = re.compile(r"^```(\w*)\n(.*?)^```$", re.DOTALL | re.MULTILINE)


def _text(name: str) -> str:
    return (ROOT / name).read_text(encoding="utf-8")


def _name(page: Path) -> str:
    return page.relative_to(ROOT).as_posix()


def _code_blocks():
    for page in PAGES:
        text = page.read_text(encoding="utf-8")
        blocks = list(FENCE.finditer(text))
        for match, after in itertools.pairwise([*blocks, None]):
            if match[1] == "python":
                line = text[: match.start()].count("\n") + 2
                follows = after is not None and not text[match.end() : after.start()].strip()
                shown = after[2] if follows and after[1] == "text" else ""
                yield pytest.param(page, line, match[2], shown, id=f"{_name(page)}:{line}")


def _unquoted(cell: str) -> str:
    return cell.removeprefix("`").removesuffix("`")


@pytest.mark.slow
@pytest.mark.parametrize(("page", "line", "code", "shown"), list(_code_blocks()))
def test_python_in_the_documentation_gives_what_is_shown(
    page, line, code, shown, tmp_path, monkeypatch, capsys
):
    """A block ``text`` right after the code is its output, or some lines of it."""
    monkeypatch.chdir(tmp_path)
    # blank lines before the code, so that a failure points into the page
    exec(compile("\n" * (line - 1) + code, str(page), "exec"), {"__name__": "__docs__"})
    output = capsys.readouterr().out
    assert output
    assert_shown(shown, output)


@pytest.mark.parametrize("page", PAGES, ids=_name)
def test_links_to_files_and_headings_lead_somewhere(page):
    text = FENCE.sub("", page.read_text(encoding="utf-8"))
    for target in re.findall(r"\]\(([^)\s]+)\)", text):
        if re.match(r"\w+:", target):
            continue
        path, _, anchor = target.partition("#")
        file = (page.parent / path).resolve() if path else page
        assert file.is_relative_to(ROOT), target
        assert file.exists(), f"{_name(page)} links to {target}"
        if anchor:
            headings = re.findall(r"^#+ (.*)$", file.read_text(encoding="utf-8"), re.MULTILINE)
            anchors = [re.sub(r"[^\w\- ]", "", h).lower().replace(" ", "-") for h in headings]
            assert anchor in anchors, f"{_name(page)} links to {target}"


@pytest.mark.parametrize("page", PAGES, ids=_name)
def test_source_files_named_in_the_documentation_exist(page):
    for name in re.findall(r"`([\w/]+\.py)`", page.read_text(encoding="utf-8")):
        places = [ROOT / name, ROOT / "src/quietbus" / name, ROOT / "src/quietbus/dynamics" / name]
        assert any(place.is_file() for place in places), f"{_name(page)} names {name}"


def test_documents_named_in_the_source_exist():
    for source in (ROOT / "src").rglob("*.py"):
        for name in re.findall(r"\bdocs/[\w./-]+\w", source.read_text(encoding="utf-8")):
            assert (ROOT / name).is_file(), f"{source} names {name}"


def test_equations_of_the_theory_are_numbered_in_order():
    theory = _text("docs/theory.md")
    numbers = [int(number) for number in re.findall(r"\\tag\{(\d+)\}", theory)]
    assert numbers == list(range(1, len(numbers) + 1))
    assert theory.count("$$") % 2 == 0
    for named in re.findall(r"theory\.md, eq\. (\d+)", _text("docs/notation.md")):
        assert int(named) in numbers


def test_results_page_has_every_variable_with_dimensions_and_unit():
    heading = ("variable", "dimensions after `time`", "unit", "meaning", "frame")
    documented = {
        _unquoted(name): (tuple(dimensions.split(", ")) if dimensions else (), unit)
        for name, dimensions, unit, _, _ in table(_text("docs/results.md"), heading)
    }
    variables = VARIABLES | CONTROL_VARIABLES | CHANGING_VARIABLES | JOINT_VARIABLES
    described = {name: (dims, unit) for name, (dims, unit, _) in variables.items()}
    assert documented == described


@pytest.mark.slow
def test_results_page_has_every_dimension_and_attribute_of_a_run():
    page = _text("docs/results.md")
    run = qb.simulate("zhang2012", duration=0.01)
    attributes = {_unquoted(name) for name, _ in table(page, ("attribute", "meaning"))}
    assert attributes == set(run.attrs)
    dimensions = {_unquoted(row[0]) for row in table(page, ("dimension", "length", "labels"))}
    assert dimensions == set(run.sizes)
    for variable in run.data_vars.values():
        assert variable.attrs.keys() == {"units", "long_name"}


def test_results_page_has_every_number_of_a_summary():
    page = _text("docs/results.md")
    for name in Summary.__dataclass_fields__:
        assert f"`{name}`" in page or name == "residual_note", name


def test_readme_lists_the_commands():
    rows = table(_text("README.md"), ("command", "does"))
    documented = {re.search(r"quietbus (\w+)", row[0])[1] for row in rows if "quietbus" in row[0]}
    assert documented == set(typer.main.get_command(cli.app).commands)


@pytest.mark.slow
def test_readme_has_the_jitter_that_the_demo_finds():
    """All lines have one frequency: the envelope is the peak that a direct run shows."""
    envelope = {}
    for mount in ("isolated", "rigid"):
        run = qb.simulate("zhang2012", mount=mount, method="harmonic", duration=60, output_rate=0.1)
        envelope[mount] = np.degrees(run["bus_rate_jitter_envelope"].isel(time=-1))
    rows = table(_text("README.md"), ("jitter, peak", "isolated", "rigid", "ratio"))
    for axis, isolated, rigid, ratio in rows:
        found = [float(envelope[mount].sel(axis=axis)) for mount in envelope]
        for shown, real in zip((isolated, rigid), found, strict=True):
            assert_rounds(shown, real)
        assert_rounds(ratio, 100.0 * found[0] / found[1])


def test_readme_names_the_built_in_scenarios_and_the_settings():
    readme = _text("README.md")
    for name in builtin_names():
        assert f"`{name}`" in readme
    settings = _text("src/quietbus/jaxconfig.py")
    for name, _, _ in table(readme, ("setting", "value", "why")):
        assert _unquoted(name) in settings
    for name in re.findall(r'os\.environ(?:\.\w+\(|\[)"(\w+)"', settings):
        assert f"`{name}`" in readme


def test_scenario_page_has_every_key_with_unit_and_default():
    page = _text("docs/scenario.md")
    rows = table(page, ("key", "unit", "default", "meaning"))
    documented = {_unquoted(key): (unit, default) for key, unit, default, _ in rows}
    assert len(documented) == len(rows), "a key is documented twice"
    keys: dict = {}
    for key, described in _keys(qb.Scenario):
        if key in keys and key.startswith("cluster."):
            continue  # what CMGs and wheels have in common is described once, as of CMGs
        keys[key] = described
    mappings = {key for key, (is_mapping, _, _) in keys.items() if is_mapping}
    assert documented.keys() - keys.keys() == set()
    assert {key for key in mappings if f"`{key}`" not in page} == set()
    assert keys.keys() - mappings - documented.keys() == set()
    for key, (unit, default) in documented.items():
        _, true_unit, true_default = keys[key]
        assert unit == true_unit, key
        assert _same_default(_unquoted(default), true_default), f"{key}: {true_default}"


@pytest.mark.parametrize(
    "block", [code for kind, code in FENCE.findall(_text("docs/scenario.md")) if kind == "yaml"]
)
def test_yaml_of_the_scenario_page_is_read(block):
    """Each block put into the built-in satellite in place of what that has."""
    shown = YAML(typ="safe").load(block)
    if "rotor" in shown:
        shown = {"cluster": shown}
    whole = _put(qb.load_scenario("zhang2012").to_dict(), shown)
    scenario = qb.Scenario.from_dict(whole)
    assert qb.Scenario.from_yaml(scenario.to_yaml()) == scenario
    assert scenario != qb.load_scenario("zhang2012")


def _put(data: dict, shown: dict) -> dict:
    """Data with what is shown; a strut takes the place of stiffness and damping."""
    if "strut" in shown:
        data = {key: value for key, value in data.items() if key not in ("stiffness", "damping")}
    inner = {
        key: _put(data[key], value)
        for key, value in shown.items()
        if isinstance(value, dict) and isinstance(data.get(key), dict)
    }
    return data | shown | inner


def test_scenario_page_names_every_choice():
    page = _text("docs/scenario.md")
    for word in (*LAWS, "isolated", "rigid", "bus", "plate", "body", "inertial", "constant"):
        assert f"`{word}`" in page


def test_glossary_names_what_exists():
    known = {key for key, _ in _keys(qb.Scenario)} | set(METRICS) | {"jitter_change_error"}
    known |= set(VARIABLES | CHANGING_VARIABLES | JOINT_VARIABLES)
    known |= {f"quietbus {name}" for name in typer.main.get_command(cli.app).commands} | {
        f"qb.{name}" for name in qb.__all__
    }
    known |= {f"NAME_jitter_{kind}" for kind in ("amplitude", "phase", "envelope")}
    known |= {f"NAME_jitter_{kind}" for kind in ("worst_case", "rss", "rms")}
    rows = table(_text("docs/glossary.md"), ("word", "meaning", "in quietbus"))
    assert len({word for word, _, _ in rows}) == len(rows)
    for word, _, where in rows:
        for name in re.findall(r"`([^`]+)`", where):
            assert name in known, f"{word}: {name}"


def _keys(model: type[Part], prefix: str = ""):
    """Every key below a mapping: dotted path, whether it holds a mapping, unit, default."""
    hints = typing.get_type_hints(model, include_extras=True)
    for name, field in model.model_fields.items():
        parts, units, listed = _contents(hints[name])
        count = any(isinstance(each, Count) for each in getattr(hints[name], "__metadata__", ()))
        unit = units[0] or "-" if units else "-" if count else ""
        default = "required" if field.is_required() else field.default
        key = prefix + name
        if model in (Unit, Wheel, Platform, Payload):
            parts = []  # its rotor, isolator and other parts have the keys of the one that is told
        yield key, (bool(parts), unit, default)
        named = typing.get_origin(_bare(hints[name])) is dict
        for part in parts:
            below = f"{key}[]." if listed else f"{key}.NAME." if named else f"{key}."
            yield from _keys(part, below)


def _contents(annotation):
    """Mappings and units inside an annotation, and whether it is a list of mappings alone."""
    parts, units, listed, left = [], [], False, [annotation]
    while left:
        item = left.pop(0)
        origin, arguments = typing.get_origin(item), typing.get_args(item)
        if origin is tuple and arguments[-1] is Ellipsis:
            # one part for all legs or a list of them is written once, as one part
            inside = _contents(arguments[0])[0]
            listed = listed or (bool(inside) and not set(inside) & set(parts))
            left.insert(0, arguments[0])
        elif _is_part(item):
            parts += [item] if item not in parts else []
        elif isinstance(item, Quantity):
            units.append(item.unit)
        elif origin is not typing.Literal:
            left[:0] = [*arguments, *getattr(item, "__metadata__", ())]
    return parts, units, listed


def _bare(annotation):
    """A type without what annotates it."""
    return annotation.__origin__ if hasattr(annotation, "__metadata__") else annotation


def _is_part(item) -> bool:
    return isinstance(item, type) and typing.get_origin(item) is None and issubclass(item, Part)


def _same_default(documented: str, default) -> bool:
    if default is None or isinstance(default, str):
        return documented == (default or "none")
    try:
        value = json.loads(documented)
    except ValueError:
        return False
    if isinstance(default, bool | dict):
        return value == default
    return np.shape(value) == np.shape(default) and np.allclose(value, default, rtol=1e-4)
