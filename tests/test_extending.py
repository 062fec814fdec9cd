"""Parts of a user's own: docs/extending.md, done as it says."""

import re
import subprocess
import sys
from pathlib import Path

import pytest

from oracles.pages import assert_shown

PAGE = Path(__file__).parents[1] / "docs" / "extending.md"
BLOCK = re.compile(r'^```(\w+)(?: title="([\w.]+)")?\n(.*?)^```$', re.DOTALL | re.MULTILINE)


@pytest.fixture(scope="module")
def folder(tmp_path_factory):
    """The page's files, and a scenario with its lines."""
    folder = tmp_path_factory.mktemp("extending")
    files: dict[str, str] = {}
    for _, name, code in BLOCK.findall(PAGE.read_text(encoding="utf-8")):
        if name:
            files[name] = files.get(name, "") + code
    for name, code in files.items():
        (folder / name).write_text(code, encoding="utf-8")
    _run(folder, "-c", _WRITE)
    return folder


_WRITE = f"""
import quietbus as qb, own_parts
from ruamel.yaml import YAML
data = qb.load_scenario("zhang2012").to_dict()
page = YAML(typ="safe").load(open({str(PAGE)!r}).read().split("```yaml\\n")[1].split("```")[0])
legs = data["isolator"]["legs"]
del legs["stiffness"], legs["damping"]
legs["strut"] = page["isolator"]["legs"]["strut"]
data["actuators"] = page["actuators"]
open("my.yaml", "w").write(qb.Scenario.from_dict(data).to_yaml())
"""


def _run(folder: Path, *arguments: str) -> str:
    done = subprocess.run(
        [sys.executable, *arguments], cwd=folder, capture_output=True, text=True, check=False
    )
    assert not done.returncode, done.stderr
    return done.stdout


def test_python_example_gives_what_is_shown(folder):
    shown = PAGE.read_text(encoding="utf-8").split("```text\n")[1].split("```")[0]
    output = _run(folder, "check.py")
    assert_shown(shown.replace("apart by\n", ""), output)
    assert float(output.split("apart by")[1]) < 1e-9


def test_command_of_the_page_runs_with_both_parts(folder):
    command = re.search(r"^quietbus (--parts .*)$", PAGE.read_text(encoding="utf-8"), re.MULTILINE)
    arguments = [part.strip('"') for part in re.findall(r'"[^"]*"|\S+', command[1])]
    output = _run(folder, "-m", "quietbus", *arguments)
    assert "6 of type d_strut" in output
    assert "rods (torque_rods)" in output
    without = subprocess.run(
        [sys.executable, "-m", "quietbus", *arguments[2:]],
        cwd=folder,
        capture_output=True,
        text=True,
        check=False,
    )
    assert without.returncode == 2
    assert "isolator.legs.strut.type (line" in without.stderr
    assert "actuators.rods.type" in without.stderr


@pytest.mark.parametrize(
    ("text", "said"),
    [
        (None, "expected a Python file"),
        ("import nothing_of_this_name\n", "line 1: ModuleNotFoundError"),
        ("\nx = (\n", "line 2: SyntaxError"),
    ],
)
def test_a_file_of_parts_that_cannot_be_used_is_told(folder, text, said):
    file = folder / "bad_parts.py"
    file.unlink(missing_ok=True)
    if text is not None:
        file.write_text(text)
    done = subprocess.run(
        [sys.executable, "-m", "quietbus", "--parts", file.name, "init", "x.yaml"],
        cwd=folder,
        capture_output=True,
        text=True,
        check=False,
    )
    assert done.returncode == 2
    assert said in done.stderr
    assert len(done.stderr.strip().splitlines()) == 1
