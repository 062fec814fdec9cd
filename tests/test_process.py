"""What quietbus changes in the process of who imports it: what docs/api.md says, and no more."""

import json
import os
import subprocess
import sys
from pathlib import Path

import diffrax
import jax
import jax.numpy as jnp
import numpy as np
import pytest
from platformdirs import user_cache_path

from quietbus.solve.integrator import diffeqsolve

SCRIPT = """
import json, logging, os, sys, warnings

def settings():
    loggers = {"root": logging.getLogger(), **logging.root.manager.loggerDict}
    return {
        "environment": dict(os.environ),
        "filters": [
            (action, getattr(message, "pattern", message), category.__module__)
            for action, message, category, *_ in warnings.filters
        ],
        "loggers": {
            name: (each.level, [type(handler).__name__ for handler in each.handlers], each.disabled)
            for name, each in loggers.items() if isinstance(each, logging.Logger)
        },
        "jax": dict(sys.modules["jax"].config.values) if "jax" in sys.modules else None,
    }

told = [settings()]
if "jax" in sys.argv:
    import equinox, jax
    told = [settings()]
import quietbus as qb
scenario = qb.load_scenario("zhang2012")
told.append(settings())
qb.simulate(scenario, "harmonic", duration=0.05)
told.append(settings())
import equinox
import jax.numpy as jnp
from jaxlib.xla_client import CompileOptions
try:
    equinox.filter_jit(lambda x: equinox.error_if(x, x > 0, "the user's"))(jnp.ones(3))
    told.append("passed")
except RuntimeError as error:
    told.append(str(error))
options = CompileOptions()
options.executable_build_options.debug_options.xla_dump_max_hlo_modules = 3
told.append("small_while_loop" in str(options.SerializeAsString()))
print(json.dumps(told, default=repr))
"""
LIBRARIES = ("scipy", "ruamel", "builtins")  # whose warnings, or a plain Warning for all of NumPy's
OF_JAX = {"TPU_SKIP_MDS_QUERY", "TF_CPP_MIN_LOG_LEVEL"}
DOCUMENTED = {
    "jax_enable_x64",
    "jax_compilation_cache_dir",
    "jax_persistent_cache_min_compile_time_secs",
}


def run(*arguments, **variables):
    clean = {k: v for k, v in os.environ.items() if k not in (*OF_JAX, "EQX_ON_ERROR")}
    done = subprocess.run(
        [sys.executable, "-c", SCRIPT, *arguments],
        env=clean | variables, capture_output=True, text=True, timeout=300, check=True,
    )  # fmt: skip
    return json.loads(done.stdout)


def changed(before, after):
    return {key for key in before.keys() | after.keys() if before.get(key) != after.get(key)}


def loud(loggers):
    """Loggers that say or hide something; a NullHandler does neither."""
    return {
        name: (level, kinds, disabled)
        for name, (level, handlers, disabled) in loggers.items()
        if (kinds := [k for k in handlers if k != "NullHandler"]) or level or disabled
    }


@pytest.fixture(scope="module")
def told():
    return run("jax", XLA_FLAGS="--xla_backend_optimization_level=0")


def test_importing_and_reading_a_scenario_change_nothing(told):
    before, after = told[:2]
    assert before["environment"] == after["environment"]
    assert before["jax"] == after["jax"]
    assert loud(before["loggers"]) == loud(after["loggers"])
    new = [each for each in after["filters"] if each not in before["filters"]]
    assert {each[2].partition(".")[0] for each in new} <= {"ruamel"}
    assert [each for each in after["filters"] if each in before["filters"]] == before["filters"]


def test_computing_changes_what_is_documented(told):
    before, _, after = told[:3]
    assert before["environment"] == after["environment"]
    assert changed(before["jax"], after["jax"]) == DOCUMENTED
    assert loud(before["loggers"]) == loud(after["loggers"])
    new = [each for each in after["filters"] if each not in before["filters"]]
    assert {each[2].partition(".")[0] for each in new} <= set(LIBRARIES)
    assert not any("quietbus" in str(each) for each in after["filters"])
    assert [each for each in after["filters"] if each in before["filters"]] == before["filters"]


def test_xla_has_the_options_that_the_environment_does_not_show(told):
    assert told[4] is True


def test_a_process_without_jax_gets_what_jax_itself_sets_alone():
    before, loaded, after, said, fast = run()
    assert loaded["jax"] is None
    assert before["environment"] == loaded["environment"]
    assert changed(before["environment"], after["environment"]) == OF_JAX
    assert "the user's" in said  # Equinox, loaded by quietbus, raises as ever
    assert fast


def test_what_the_user_has_chosen_is_kept():
    own = f"{user_cache_path('quietbus', appauthor=False) / 'jax'}/."  # chosen, and full already
    chosen = {"JAX_COMPILATION_CACHE_DIR": own, "EQX_ON_ERROR": "off"}
    before, _, after, said, _ = run("jax", **chosen)
    assert before["environment"] == after["environment"]
    assert changed(before["jax"], after["jax"]) == {"jax_enable_x64"}
    assert said == "passed"


def test_the_reference_lists_the_settings():
    page = (Path(__file__).parents[1] / "docs" / "api.md").read_text(encoding="utf-8")
    for name in (*DOCUMENTED, *OF_JAX, "XLA_FLAGS", "EQX_ON_ERROR"):
        assert f"`{name}`" in page


def decay(solve):
    """y(t) of dy/dt = -y by a solver of Diffrax, compiled."""

    def rate(t, y, args):
        return -y

    steps = diffrax.PIDController(rtol=1e-11, atol=1e-11)

    @jax.jit
    def flown(start, end, at, step):
        saved = diffrax.SaveAt(ts=at)
        flight = solve(
            diffrax.ODETerm(rate), diffrax.Dopri8(), start, end, step, jnp.ones(1),
            saveat=saved, stepsize_controller=steps, adjoint=diffrax.ForwardMode(), throw=False,
        )  # fmt: skip
        return flight.ys[:, 0]

    return flown


INSTANTS = (jnp.array(0.0), jnp.array(1.0), jnp.array([0.0, 0.5, 1.0]), jnp.array(0.1))


@pytest.mark.skipif("EQX_ON_ERROR" in os.environ, reason="then Diffrax is taken as it is")
def test_the_integrator_s_programs_can_be_kept():
    """JAX keeps no program that calls back; Diffrax's own does."""
    lowered = {s: decay(s).lower(*INSTANTS).as_text() for s in (diffeqsolve, diffrax.diffeqsolve)}
    assert "callback" not in lowered[diffeqsolve]
    assert "callback" in lowered[diffrax.diffeqsolve]
    np.testing.assert_allclose(decay(diffeqsolve)(*INSTANTS), np.exp([0.0, -0.5, -1.0]), rtol=1e-10)


@pytest.mark.skipif("EQX_ON_ERROR" in os.environ, reason="then Diffrax is taken as it is")
@pytest.mark.parametrize("at", [[0.0, 0.7, 0.5], [0.0, 0.5, 2.0]])
def test_instants_out_of_order_or_flight_give_no_number(at):
    start, end, _, step = INSTANTS
    assert not np.all(np.isfinite(decay(diffeqsolve)(start, end, jnp.array(at), step)))
