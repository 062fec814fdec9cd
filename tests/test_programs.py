"""Programs kept from one process to the next: the same answers, whatever happens to the files."""

import os
import subprocess
import sys
import warnings
from pathlib import Path

import equinox as eqx
import jax
import jax.numpy as jnp
import numpy as np
import pytest

from oracles.satellites import paper_satellite
from quietbus import programs
from quietbus.dynamics import linearize
from quietbus.programs import KeptProgramWarning, Program

TESTS = Path(__file__).parent
ANGLES = jnp.array([0.1, -0.2, 0.3, 0.4])


@pytest.fixture
def folder(tmp_path, monkeypatch):
    """An empty place for programs, and none warned of yet."""
    monkeypatch.setattr(programs, "_folder", lambda: tmp_path / "programs" / "here")
    programs._warned.cache_clear()
    return tmp_path / "programs" / "here"


@pytest.fixture
def traced(monkeypatch):
    """How often a program was made from Python."""
    calls = []
    whole = Program._compile
    monkeypatch.setattr(
        Program, "_compile", lambda self, *args: calls.append(1) or whole(self, *args)
    )
    return calls


def fresh():
    """A program as a new process has it, with nothing loaded."""
    return Program(linearize._carried_mass._function, programs._few_runs)


def answer():
    return np.asarray(fresh()(paper_satellite(), ANGLES, "plate"))


@pytest.mark.usefixtures("folder")
def test_kept_program_is_not_traced_again_and_gives_the_same(traced):
    first, second = answer(), answer()
    assert len(traced) == 1
    np.testing.assert_array_equal(first, second)
    plain = eqx.filter_jit(linearize._carried_mass._function)(paper_satellite(), ANGLES, "plate")
    np.testing.assert_allclose(first, plain, rtol=1e-12, atol=1e-12)


@pytest.mark.usefixtures("folder")
def test_numbers_are_arguments_and_structure_is_not(traced):
    light = answer()
    satellite = eqx.tree_at(
        lambda s: s.bodies[1].mass_X, paper_satellite(), jnp.asarray(np.array(1234.0))
    )
    heavy = fresh()(satellite, ANGLES, "plate")
    assert len(traced) == 1
    assert float(np.max(np.abs(heavy - light))) > 100.0
    fresh()(paper_satellite(), ANGLES.astype(jnp.float32), "plate")
    assert len(traced) == 2


@pytest.mark.usefixtures("folder")
def test_arguments_that_are_not_used_are_told_apart(traced):
    def doubled(*each):
        return 2.0 * each[0]

    doubled.__module__ = "quietbus.tests"
    for args in ((1.0,), (1.0, 5.0), (1.0, 5.0, 6.0), (1.0, 5.0)):
        found = Program(doubled, dict)(*map(np.array, args))
        np.testing.assert_array_equal(found, 2.0)
    assert len(traced) == 3


@pytest.mark.parametrize("kind", ["*.program", "*/*"])
@pytest.mark.parametrize(
    "damage",
    [
        lambda _: b"",
        lambda data: data[: len(data) // 2],
        lambda data: data[:40] + bytes([data[40] ^ 1]) + data[41:],
        lambda _: b"hello " * 1000,
    ],
    ids=["empty", "half", "one bit", "foreign"],
)
def test_damaged_file_costs_a_warning_and_is_mended(folder, traced, kind, damage):
    whole = answer()
    (file,) = [f for f in folder.glob(kind) if f.is_file()]
    file.write_bytes(damage(file.read_bytes()))
    with pytest.warns(KeptProgramWarning, match=r"cannot be read .* it is made anew"):
        np.testing.assert_array_equal(answer(), whole)
    assert len(traced) == 2
    with warnings.catch_warnings():
        warnings.simplefilter("error")
        np.testing.assert_array_equal(answer(), whole)
    assert len(traced) == 2


def test_file_gone_is_made_anew(folder, traced):
    whole = answer()
    for file in [f for f in folder.rglob("*") if f.is_file()]:
        file.unlink()
        np.testing.assert_array_equal(answer(), whole)
    assert len(traced) == 3


def test_other_sources_are_traced_and_find_their_machine_code(folder, traced, monkeypatch):
    whole = answer()
    monkeypatch.setattr(programs, "_sources", lambda: "other")
    monkeypatch.setattr(programs, "_write_program", None)  # not called: nothing is compiled
    np.testing.assert_array_equal(answer(), whole)
    assert len(traced) == 2
    assert len(list(folder.glob("*.program"))) == 1


@pytest.mark.parametrize("what", ["jax", "flags", "processor", "precision"])
def test_other_versions_settings_and_machines_have_a_folder_of_their_own(monkeypatch, what):
    own = programs._folder.__wrapped__()
    if what == "jax":
        known = programs.version
        monkeypatch.setattr(programs, "version", lambda n: known(n) + ("x" if n == "jax" else ""))
    elif what == "flags":
        monkeypatch.setattr(programs, "XLA_FLAGS", "--xla_cpu_enable_fast_math=true")
    elif what == "processor":
        monkeypatch.setattr(programs, "_processor", lambda: "a toaster")
    else:
        with jax.default_matmul_precision("high"):
            assert programs._folder.__wrapped__() != own
        return
    assert programs._folder.__wrapped__() != own


def test_folder_that_cannot_be_written_costs_one_warning(tmp_path, monkeypatch):
    programs._warned.cache_clear()
    (tmp_path / "file").write_text("in the way")
    monkeypatch.setattr(programs, "_folder", lambda: tmp_path / "file" / "here")
    with pytest.warns(KeptProgramWarning, match="cannot be kept"):
        whole = answer()
    with warnings.catch_warnings():
        warnings.simplefilter("error")
        np.testing.assert_array_equal(answer(), whole)


def test_what_is_a_users_own_is_not_kept(folder, traced):
    class Mine(eqx.Module):
        value: jax.Array

    known = Program(linearize._carried_mass._function, dict)
    known._function = linearize._carried_mass._function
    for described in (Mine(programs.Slot((), np.dtype(float), False)), lambda: 0):
        assert programs._entry(known._function, {}, described) is None
    assert programs._entry(lambda x: x, {}, 1.0) is None
    assert programs._entry(known._function, {}, 1.0) is not None
    assert not traced
    assert not folder.exists()


def test_what_was_not_used_for_longest_makes_room(folder, monkeypatch):
    monkeypatch.setattr(programs, "ROOM", 0)
    whole = answer()
    assert len(list(folder.glob("*.program"))) == 1  # written after room was made
    fresh()(paper_satellite(), ANGLES.astype(jnp.float32), "plate")
    assert len(list(folder.glob("*.program"))) == 1
    np.testing.assert_array_equal(answer(), whole)


RUN = """
import sys, numpy as np
from oracles.satellites import paper_satellite
from quietbus import programs
from quietbus.dynamics.linearize import OperatingPoint, linearize
if sys.argv[1] == "kept":
    programs.Program._compile = None  # not called
point = OperatingPoint(np.zeros(3), np.array([0.1, 0.2, 0.3, 0.4]))
for actuator in ("servo", "ideal"):
    model = linearize(paper_satellite(), point, actuator)
    print([each.tobytes().hex() for each in (model.A, model.B, model.C, model.D)], model.outputs)
"""


@pytest.mark.parametrize("flags", ["", "--xla_force_host_platform_device_count=3"])
def test_fresh_processes_share_programs_even_at_once(tmp_path, flags):
    """The second traces nothing; without LAPACK made ready, machine code read ends the process."""

    def start(how):
        return subprocess.Popen(
            [sys.executable, "-c", RUN, how],
            env={
                **os.environ,
                "PYTHONPATH": os.pathsep.join([str(TESTS), os.environ.get("PYTHONPATH", "")]),
                "XLA_FLAGS": f"{os.environ.get('XLA_FLAGS', '')} {flags}",
                "JAX_COMPILATION_CACHE_DIR": str(tmp_path),
            },
            stdout=subprocess.PIPE,
            stderr=subprocess.PIPE,
            text=True,
        )

    def finish(process):
        out, err = process.communicate()
        assert process.returncode == 0, err
        assert "warn" not in err.lower()
        return out

    one, other = start("new"), start("new")
    first = finish(one)
    assert finish(other) == first
    assert finish(start("kept")) == first
