"""Making, keeping, failing and going on, with a small paper of its own."""

import inspect
import json
import math
import subprocess
import sys
from dataclasses import replace
from importlib.resources import files

import jsonschema
import pytest
from matplotlib.figure import Figure

from quietbus import cli
from quietbus.reproduce import load_paper, sources
from quietbus.reproduce.claims import Claim
from quietbus.reproduce.paper import MissingExtra, reproduce
from quietbus.reproduce.parts import Findings, Paper, Part
from quietbus.reproduce.sources import ROOT, sources_of

SCHEMA = json.loads(files("quietbus.reproduce").joinpath("table.schema.json").read_text())


class Small:
    """A paper of three figures that counts how often each is made."""

    def __init__(self):
        self.calls = []
        self.trouble = {}
        self.numbers = {}
        self.paper = Paper(
            "small",
            "Nobody, nowhere",
            [
                Claim(name, "eq. 1", "a number", "1.0", "m", "because", "simulated")
                for name in ("one", "two", "three")
            ],
            {
                "First": (Part("one", "One", self.maker("one")),),
                "Second": tuple(Part(n, n.title(), self.maker(n)) for n in ("two", "three")),
            },
            bench=lambda shop: shop,
        )

    def maker(self, name):
        def make(_bench):
            self.calls.append(name)
            if name in self.trouble:
                raise self.trouble[name]
            numbers = {name: self.numbers.get(name, 1.0)}
            return Findings(Figure((1, 1)), f"caption of {name}", numbers, f"text of {name}")

        return make


@pytest.fixture
def small():
    return Small()


def read(folder):
    table = json.loads((folder / "table.json").read_text())
    jsonschema.validate(table, SCHEMA)
    return table


def test_report_and_table_hold_every_figure_caption_and_number(small, tmp_path):
    outcome = reproduce(small.paper, tmp_path)
    assert outcome.made == ("one", "two", "three")
    table, report = read(tmp_path), (tmp_path / "report.md").read_text()
    assert [row["verdict"] for row in table["rows"]] == ["within rounding"] * 3
    for name in small.calls:
        assert (tmp_path / f"{name}.png").read_bytes().startswith(b"\x89PNG")
        for text in (f"caption of {name}", f"text of {name}", f"({name}.png)"):
            assert text in report
    assert (
        "| eq. 1 | a number | 1.0 m | 1 m | +0 % | simulated | within rounding | because |"
        in report
    )


def test_what_is_made_is_not_made_again_unless_asked(small, tmp_path):
    reproduce(small.paper, tmp_path)
    again = reproduce(small.paper, tmp_path)
    assert (again.made, again.kept) == ((), ("one", "two", "three"))
    assert len(small.calls) == 3
    assert len(reproduce(small.paper, tmp_path, fresh=True).made) == 3


@pytest.mark.parametrize("harm", ["picture cut", "picture gone", "numbers cut", "numbers of old"])
def test_what_is_not_whole_or_of_other_sources_is_made_again(small, tmp_path, harm):
    reproduce(small.paper, tmp_path)
    picture, numbers = tmp_path / "two.png", tmp_path / ".made" / "two.json"
    if harm == "picture cut":
        picture.write_bytes(picture.read_bytes()[:100])
    elif harm == "picture gone":
        picture.unlink()
    elif harm == "numbers cut":
        numbers.write_text(numbers.read_text()[:40])
    else:
        numbers.write_text(numbers.read_text().replace('"key": "', '"key": "old'))
    (tmp_path / ".made" / ".quietbus-0123.part").write_text("left behind")
    assert reproduce(small.paper, tmp_path).made == ("two",)
    assert not list(tmp_path.rglob("*.part"))


def package(tmp_path, monkeypatch):
    """A package of its own in which two figures share one module."""
    text = {
        "__init__.py": "",
        "shared.py": "import numpy\nfrom quietbus.deep import depth\n",
        "deep.py": "def depth():\n    import scipy.linalg\n",
        "one.py": "from quietbus import shared\n",
        "two.py": "from quietbus.shared import x\nimport mujoco\nimport json\n"
        "if TYPE_CHECKING:\n    from quietbus.other import T\n",
        "other.py": "import matplotlib\n",
        "data.yaml": "a: 1\n",
    }
    for name, content in text.items():
        (tmp_path / name).write_text(content)
    monkeypatch.setattr(sources, "ROOT", tmp_path)
    sources.imports.cache_clear()


def test_a_figure_depends_on_what_its_module_imports_and_on_nothing_else(tmp_path, monkeypatch):
    package(tmp_path, monkeypatch)
    one, two = (sources_of(tmp_path / f"{name}.py") for name in ("one", "two"))
    assert set(one.modules) == {"one.py", "shared.py", "deep.py"}
    assert set(two.modules) == {"two.py", "shared.py", "deep.py"}
    assert one.libraries == {"numpy", "scipy"}
    assert two.libraries == {"numpy", "scipy", "mujoco"}


@pytest.mark.parametrize(
    ("changed", "again"),
    [
        ("one.py", "one"),
        ("two.py", "two"),
        ("other.py", ""),
        ("shared.py", "one two"),
        ("deep.py", "one two"),
        ("data.yaml", "one two"),
    ],
)
def test_a_figure_is_made_again_where_its_sources_change(tmp_path, monkeypatch, changed, again):
    package(tmp_path, monkeypatch)
    digests = lambda: {n: sources_of(tmp_path / f"{n}.py").digest() for n in ("one", "two")}  # noqa: E731
    before = digests()
    with (tmp_path / changed).open("a") as file:
        file.write("# changed\n")
    sources.imports.cache_clear()
    after = digests()
    assert " ".join(name for name in before if before[name] != after[name]) == again


def test_installing_an_extra_concerns_only_the_figures_that_use_it(tmp_path, monkeypatch):
    package(tmp_path, monkeypatch)
    one, two = (sources_of(tmp_path / f"{name}.py") for name in ("one", "two"))
    before = one.digest(), two.digest()
    version = sources.version_of
    monkeypatch.setattr(sources, "version_of", lambda n: "9" if n == "mujoco" else version(n))
    assert one.digest() == before[0]
    assert two.digest() != before[1]


def test_parts_of_the_paper_declare_the_extras_they_use():
    """Only the comparison with the engine needs more than quietbus itself does."""
    paper = load_paper("zhang2012")
    text = (ROOT / "reproduce" / "zhang2012" / "engine.py").read_text()
    assert "quietbus.validate" in text
    for part in paper.parts:
        found = sources_of(inspect.getfile(part.make))
        assert ("mujoco" in found.libraries) == ("mujoco" in part.needs), part.name
        assert not {"cli", "report", "tables.py"} & {n.partition("/")[0] for n in found.modules}
        assert "dynamics/equations.py" in found.modules


def test_missing_extra_is_told_before_anything_is_computed(small, tmp_path):
    first, second = small.paper.chapters["Second"]
    needing = replace(second, needs={"no_such_module": "validate"})
    small.paper.chapters["Second"] = (first, needing)
    with pytest.raises(MissingExtra, match=r"three needs no_such_module: pip install 'quietbus\[v"):
        reproduce(small.paper, tmp_path)
    assert not small.calls
    outcome = reproduce(small.paper, tmp_path, partial=True)
    assert outcome.made == ("one", "two")
    assert "needs no_such_module" in outcome.failed["three"]
    small.paper.chapters["Second"] = (first, second)
    assert reproduce(small.paper, tmp_path).made == ("three",)
    small.paper.chapters["Second"] = (first, needing)  # made before: nothing is missing
    assert reproduce(small.paper, tmp_path).made == ()


def test_a_figure_that_fails_leaves_the_others_and_is_named(small, tmp_path):
    small.trouble["two"] = ImportError("no engine")
    outcome = reproduce(small.paper, tmp_path)
    assert outcome.made == ("one", "three")
    table = read(tmp_path)
    assert table["failed"] == [{"name": "two", "reason": "ImportError: no engine"}]
    assert [row["verdict"] for row in table["rows"]][1] == "not computed"
    assert "no engine" in (tmp_path / "report.md").read_text()
    small.trouble.clear()
    assert reproduce(small.paper, tmp_path).made == ("two",)


@pytest.mark.parametrize("odd", [math.nan, math.inf])
def test_a_number_that_json_cannot_hold_fails_its_part_only(small, tmp_path, odd):
    small.numbers["two"] = odd
    outcome = reproduce(small.paper, tmp_path)
    assert outcome.made == ("one", "three")
    assert "expected finite numbers, got others for two" in read(tmp_path)["failed"][0]["reason"]
    assert not (tmp_path / "two.png").exists()


def test_an_interrupt_keeps_what_is_made_and_the_next_start_goes_on(small, tmp_path):
    small.trouble["two"] = KeyboardInterrupt()
    outcome = reproduce(small.paper, tmp_path)
    assert outcome.interrupted
    assert outcome.made == ("one",)
    assert read(tmp_path)["failed"] == []
    small.trouble.clear()
    assert reproduce(small.paper, tmp_path).made == ("two", "three")


@pytest.mark.parametrize(
    ("trouble", "said"),
    [
        (None, ""),
        (ValueError("no such number"), "two: ValueError"),
        (KeyboardInterrupt(), "continue"),
    ],
)
def test_the_command_ends_with_status_1_unless_all_is_made(
    small, tmp_path, monkeypatch, capsys, trouble, said
):
    if trouble:
        small.trouble["two"] = trouble
    monkeypatch.setattr("quietbus.reproduce.load_paper", lambda _name: small.paper)
    monkeypatch.setattr("signal.signal", lambda *_: None)
    monkeypatch.setattr(sys, "argv", ["quietbus", "reproduce", "zhang2012", "-o", str(tmp_path)])
    with pytest.raises(SystemExit) as ended:
        cli.main()
    assert (ended.value.code or 0) == (1 if trouble else 0)
    assert said in capsys.readouterr().err
    read(tmp_path)


def run(*arguments):
    command = [sys.executable, "-m", "quietbus", "reproduce", *map(str, arguments)]
    return subprocess.run(command, capture_output=True, text=True, check=False)


def test_bad_input_is_told_with_status_2(tmp_path):
    unknown = run("zhang2013")
    assert unknown.returncode == 2
    assert "known: zhang2012" in unknown.stderr
    (tmp_path / "file").write_text("")
    blocked = run("zhang2012", "-o", tmp_path / "file")
    assert blocked.returncode == 2
    assert "Traceback" not in unknown.stderr + blocked.stderr
