"""Parts of a user's own that are wrong: those of the page with one thing changed, and what is told.

What an exception says is its library's; messages are compared up to there.
"""

import re
from pathlib import Path

import numpy as np
import pytest

import quietbus as qb
from quietbus.build import build_satellite, energy_notes
from quietbus.cli.guard import BadInput
from quietbus.cli.own_parts import load_parts
from quietbus.scenario import ScenarioError
from quietbus.scenario.actuators import ACTUATORS
from quietbus.scenario.struts import STRUTS

PAGE = (Path(__file__).parents[1] / "docs" / "extending.md").read_text(encoding="utf-8")
PARTS = "".join(re.findall(r'^```py title="own_parts.py"\n(.*?)^```$', PAGE, re.M | re.S))
STRUT = {"type": "d_strut", "stiffness": 20e3, "series_stiffness": 100e3, "damping": 900.0}
SPRING = {"stiffness": 20e3, "damping": 500.0}
RODS = {"type": "torque_rods", "torque": 0.5, "lag": 0.02}
AT_STRUT, AT_RODS = "isolator.legs.strut: ", "actuators.rods: "


@pytest.fixture
def load(tmp_path, monkeypatch):
    """Registers the page's parts with pieces of their text replaced; the file they are in."""
    for kinds in (STRUTS, ACTUATORS):
        monkeypatch.setattr(kinds, "known", dict(kinds.known))

    def load(*changes):
        text = PARTS
        for old, new in changes:
            assert text.count(old) == 1, old
            text = text.replace(old, new)
        file = tmp_path / "own_parts.py"
        file.write_text(text, encoding="utf-8")
        load_parts(file)
        return file

    return load


def scenario(**changes):
    data = qb.load_scenario("zhang2012").to_dict()
    legs = data["isolator"]["legs"]
    del legs["stiffness"], legs["damping"]
    legs["strut"] = STRUT
    return qb.Scenario.from_dict(data | {"actuators": {"rods": RODS}} | changes)


def told(checked=None):
    """What building the model says is wrong, without the scenario's name."""
    with pytest.raises(ScenarioError) as caught:
        build_satellite(checked or scenario())
    (line,) = str(caught.value).splitlines()
    return line.removeprefix("zhang2012: ")


def in_line(text, piece):
    """Number of the line of a text that has a piece."""
    return 1 + text[: text.index(piece)].count("\n")


def test_parts_of_the_page_pass(load):
    load()
    satellite = build_satellite(scenario())
    assert [each.name for each in satellite.actuators] == ["cluster", "rods"]


def test_parts_without_memory_or_commands_pass(load):
    """What a law does not have it need not say."""
    memory = f"    def memory_rate(self, length, rate, z):\n        {MEMORY}\n\n"
    load(
        ("return jnp.zeros_like(self.free_length)", "return jnp.zeros(0)"),
        (memory, ""),
        (TENSION, "return self.k_A * e"),
        (STORED, "return 0.5 * self.k_A * jnp.sum(e**2)"),
        (DISSIPATED, "return 0.0"),
        (START, "return Own.of()"),
        (NAMES, "return []"),
        (RATES, "return Rates(around.own.y, around.own.z)"),
        (BALANCE, "return jnp.zeros(6)"),
    )
    checked = scenario()
    satellite = build_satellite(checked)
    assert [each.name for each in satellite.actuators] == ["cluster"]
    assert energy_notes(checked, satellite) == ()


TENSION = "return self.k_A * e + self.k_B * (e - z)"
MEMORY = "return self.k_B * (length - self.free_length - z) / self.c"
STORED = "return 0.5 * jnp.sum(self.k_A * e**2 + self.k_B * (e - z) ** 2)"
DISSIPATED = "return self.c * jnp.sum(self.memory_rate(length, rate, z) ** 2)"
MADE = "return DStrutLaw(free_length, *map(jnp.asarray, numbers))"
LEGS = "float64 of shape (6,), one for each leg"
FINITE = "finite numbers at rest at the start of a run"
SMOOTH = "finite derivatives at rest at the start of a run"


@pytest.mark.parametrize(
    ("old", "new", "what", "expected", "got"),
    [
        (TENSION, "return jnp.sum(e)", "tension", LEGS, "float64 of shape ()"),
        (TENSION, "return e.astype('float32')", "tension", LEGS, "float32 of shape (6,)"),
        (TENSION, "return None", "tension", LEGS, "nothing"),
        (TENSION, "return [e]", "tension", LEGS, "an object of type list"),
        (TENSION, "return e, z", "tension", LEGS, "an object of type tuple"),
        (
            MEMORY,
            "return rate[:3]",
            "memory_rate",
            "float64 of shape (6,), as start has it",
            "float64 of shape (3,)",
        ),
        (
            "return jnp.zeros_like(self.free_length)",
            "return jnp.zeros((6, 2))",
            "start",
            "float64 of shape (n,), all states in a row",
            "float64 of shape (6, 2)",
        ),
        (
            "return jnp.zeros_like(self.free_length)",
            "return [0.0]",
            "start",
            "float64 of shape (n,), all states in a row",
            "an object of type list",
        ),
        (
            STORED,
            "return self.k_A * e**2",
            "stored",
            "float64 of shape (), of all legs together",
            "float64 of shape (6,)",
        ),
        (
            DISSIPATED,
            "return self.c * rate**2",
            "dissipated",
            "float64 of shape (), of all legs together",
            "float64 of shape (6,)",
        ),
        ("def stored(", "def energy(", "stored", "the law to have this method", "none"),
        (
            MADE,
            'return DStrutLaw(free_length, "stiff", *numbers[1:])',
            "k_A",
            "numbers and arrays, or eqx.field(static=True)",
            "'stiff'",
        ),
        (
            MADE,
            "return DStrutLaw(free_length[:4], *numbers)",
            "free_length",
            LEGS,
            "float64 of shape (4,)",
        ),
        (TENSION, "return jnp.log(0.0 * e)", "tension", FINITE, "-inf"),
        (MEMORY, "return 0.0 / (0.0 * z)", "memory_rate", FINITE, "nan"),
        (STORED, "return jnp.sqrt(-1.0)", "stored", FINITE, "nan"),
        (
            TENSION,
            "return self.k_A * e + jnp.sqrt(rate)",
            "tension",
            SMOOTH,
            "nan",
        ),
        (
            MEMORY,
            "return jnp.sqrt(z)",
            "memory_rate",
            SMOOTH,
            "nan",
        ),
    ],
)
def test_struts_that_give_what_they_should_not_are_told(load, old, new, what, expected, got):
    load((old, new))
    assert told() == f"{AT_STRUT}DStrutLaw.{what}: expected {expected}, got {got}"


@pytest.mark.parametrize(
    ("old", "new", "said"),
    [
        (
            TENSION,
            'raise OSError("table.csv: no such file\\nmore of it")',
            "DStrutLaw.tension: raised OSError in own_parts.py, line N: table.csv: no such file",
        ),
        (
            TENSION,
            "return e if float(e[0]) else z",
            "DStrutLaw.tension: raised ConcretizationTypeError in own_parts.py, line N: Abstract "
            "tracer value encountered where concrete value is expected",
        ),
        (
            TENSION,
            "return jnp.zeros(6) + __import__('jax').pure_callback(lambda e: e, e, e)",
            "DStrutLaw.tension, its derivatives: raised ValueError in own_parts.py, line N: Pure "
            "callbacks do not support JVP",
        ),
        (
            "def tension(self, length, rate, z):",
            "def tension(self, length, rate):",
            "DStrutLaw.tension: raised TypeError: DStrutLaw.tension() takes 3 positional arguments "
            "but 4 were given",
        ),
        (
            MADE,
            "return DStrutLaw(free_length, said.stifness, 1.0, 1.0)",
            "strut_of(DStrut): raised AttributeError in own_parts.py, line N: 'DStrut' object has "
            "no attribute 'stifness'",
        ),
        (
            "    free_length: Float",
            "    unloaded: Float",
            "strut_of(DStrut): raised TypeError in own_parts.py, line N: Can't instantiate "
            "abstract class DStrutLaw",
        ),
        (
            MADE,
            "return numbers",
            "strut_of(DStrut): expected one of AbstractStrut, got an object of type tuple",
        ),
        (
            "@strut_of.register\n",
            "",
            "DStrut: expected a function with @strut_of.register, got none",
        ),
    ],
)
def test_struts_that_raise_or_are_not_made_are_told(load, old, new, said):
    text = load((old, new)).read_text(encoding="utf-8")
    piece = MADE if MADE in text and old != TENSION else new
    assert told().startswith(AT_STRUT + said.replace("line N", f"line {in_line(text, piece)}"))


def test_struts_of_a_platform_are_told_with_its_place(load):
    load((TENSION, "return jnp.sum(e)"))
    data = scenario().to_dict()
    second = {"name": "upper", "isolator": data.pop("isolator"), "cluster": data.pop("cluster")}
    first = {**second, "name": "lower", "isolator": {**second["isolator"]}}
    legs = {**first["isolator"]["legs"], "strut": {"type": "spring_damper"} | SPRING}
    first["isolator"]["legs"] = legs
    checked = qb.Scenario.from_dict(data | {"platforms": [first, second]})
    assert told(checked).startswith("platforms[1].isolator.legs.strut: DStrutLaw.tension: ")


def test_a_quantity_where_a_part_has_a_plain_number_is_told(load):
    load(("    torque: Torque  # that one can give", "    torque: float"))
    with pytest.raises(ScenarioError) as caught:
        scenario(actuators={"rods": RODS | {"torque": "0.5 N*m"}})
    said = "expected a number without a unit, as its type has no Measure, got '0.5 N*m'"
    assert str(caught.value) == f"<data>: actuators.rods.torque: {said}"
    assert build_satellite(scenario()).actuators[1].full == 0.5


IMPORTS = "import equinox as eqx\n"
PART = f"{IMPORTS}from quietbus.extend import Part\n"


@pytest.mark.parametrize(
    ("code", "said"),
    [
        ("def per_leg(self):\n        return ('rate',)", "per_leg or spring_and_damper raised "
         "AttributeError: 'DStrut' object has no attribute 'rate'"),
        ("def spring_and_damper(self):\n        return self.k", "per_leg or spring_and_damper "
         "raised AttributeError: 'DStrut' object has no attribute 'k'"),
    ],
)  # fmt: skip
def test_what_a_kind_of_struts_says_of_itself_is_told_where_it_is_wrong(load, code, said):
    load(
        ("    series_stiffness: Stiffness\n", f"    series_stiffness: Stiffness\n\n    {code}\n\n")
    )
    with pytest.raises(ScenarioError) as caught:
        scenario()
    assert str(caught.value) == f"<data>: isolator.legs.strut: DStrut: {said}"


def test_what_a_users_own_check_says_is_told(load):
    check = """
    @pydantic.model_validator(mode="after")
    def _check(self):
        if self.series_stiffness > 4.0 * self.stiffness:
            raise ValueError("expected a series spring of at most four times the other")
        return self
"""
    line = "    damping: Damping\n"
    load((IMPORTS, f"{IMPORTS}import pydantic\n"), (line, line + check))
    with pytest.raises(ScenarioError) as caught:
        scenario()
    said = "expected a series spring of at most four times the other"
    assert str(caught.value) == f"<data>: isolator.legs.strut: {said}"


def test_a_kind_of_struts_is_made_of_their_base(load):
    with pytest.raises(BadInput, match=r"line \d+: TypeError: DStrut: expected a StrutKind with"):
        load(("class DStrut(StrutKind)", "class DStrut(Part)"), (IMPORTS, PART))


# --- energy ------------------------------------------------------------------------------------


def energy_told(checked):
    return energy_notes(checked, build_satellite(checked))


def test_struts_whose_energy_adds_up_have_no_note(load):
    load()
    assert energy_told(scenario()) == energy_told(qb.load_scenario("zhang2012")) == ()


@pytest.fixture
def power():
    """What dampers of the page's struts take [W], all e = 0.1 % long with z = 0: (k_B e)^2 / c."""
    lower, upper = qb.load_scenario("zhang2012").isolator.joints()
    e = 1e-3 * np.linalg.norm(upper - lower, axis=1)
    return np.sum((100e3 * e) ** 2) / 900.0


def test_struts_that_bring_energy_are_told(load, power):
    """A damper with the sign of c turned, which the power that is dissipated then has too."""
    load(("numbers = (said.stiffness, said.series_stiffness, said.damping)",
          "numbers = (said.stiffness, said.series_stiffness, -said.damping)"))  # fmt: skip
    assert energy_told(scenario()) == (
        f"{AT_STRUT}DStrutLaw brings energy in, which can make motions grow: with all legs 0.1 % "
        f"longer and growing by 10 mm/s tension takes {-power:.3g} W beyond what stored gains, "
        f"dissipated says {-power:.3g} W",
    )


def test_struts_that_say_they_take_what_they_bring_are_told(load, power):
    """Beside, dampers of 1e5 N s/m that push: at 0.01 m/s six of them bring 60 W."""
    load((TENSION, f"{TENSION} - 1e5 * rate"))
    (note,) = energy_told(scenario())
    assert note.startswith(f"{AT_STRUT}DStrutLaw brings energy in")
    assert f"takes {power - 60.0:.3g} W beyond" in note
    assert note.endswith(f"dissipated says {power:.3g} W")


def test_struts_without_derivatives_are_not_looked_at(load):
    """A run goes on, since one by the direct solver needs none."""
    callback = "return jax.pure_callback(lambda e: np.sum(e**2), rate[0], e)"
    load((STORED, callback),
         (IMPORTS, f"{IMPORTS}import jax\nimport numpy as np\n"))  # fmt: skip
    (note,) = energy_told(scenario())
    assert note.startswith(f"{AT_STRUT}the energy of DStrutLaw is not looked at: ")


def test_struts_that_take_more_than_they_say_are_told(load, power):
    load((DISSIPATED, f"return 0.5 * {DISSIPATED[7:]}"))
    (note,) = energy_told(scenario())
    assert note.startswith(f"{AT_STRUT}the energy of DStrutLaw does not add up")
    assert f"takes {power:.3g} W beyond" in note
    assert note.endswith(f"dissipated says {0.5 * power:.3g} W")


def test_actuators_that_say_they_bring_energy_are_told(load):
    """Here 2 W for each unit of the sum of the torques: down with all three by 0.001, -6 mW."""
    energy = "    def energy(self, around):\n        from quietbus.extend import Energy\n"
    energy += "        return Energy(0.0, 2.0 * jnp.sum(around.own.z))\n\n"
    load(
        ("    def rates(self, around, command):", f"{energy}    def rates(self, around, command):")
    )
    assert energy_told(scenario()) == (
        f"{AT_RODS}TorqueRodsLaw brings energy in, which can make motions grow: with all of its "
        "own off by 0.001, up or down, dissipated says -0.006 W",
    )


@pytest.mark.slow
def test_runs_and_studies_tell_of_struts_that_bring_energy(load):
    load((DISSIPATED, f"return -{DISSIPATED[7:]}"))
    checked = scenario()
    with pytest.warns(qb.QuietbusWarning, match=r"isolator\.legs\.strut: DStrutLaw brings energy"):
        qb.simulate(checked, "harmonic", duration=0.01)
    with pytest.warns(qb.QuietbusWarning, match=r"isolator\.legs\.strut: DStrutLaw brings energy"):
        qb.jitter(checked)
    assert any("DStrutLaw brings energy" in note for note in qb.analyze(checked).notes)


def test_struts_that_an_analysis_cannot_take_are_told(load):
    load((TENSION, f"{TENSION} - 2e3 * rate"))
    said = "DStrutLaw.tension: expected a damping of 0 or more at rest, as an analysis needs it, "
    with pytest.raises(ScenarioError, match=re.escape(f"{AT_STRUT}{said}got -2000")):
        qb.analyze(scenario()).to_dict()


# --- actuators ---------------------------------------------------------------------------------


AUTHORITY = "return Authority(around.hosts[0].R_AX, self.full, jnp.full(3, self.full))"
RATES = "return Rates(around.own.y, (command - around.own.z) / self.lag)"
BALANCE = "return jnp.concatenate([jnp.zeros(3), around.hosts[0].R_AX @ around.own.z])"
MAKES_RODS = (
    "return TorqueRodsLaw(name, (said.on,), jnp.asarray(said.torque), jnp.asarray(said.lag))"
)
NAMES = 'return [f"{self.name}_command_{axis}" for axis in "xyz"]'
SHARE = "return 1.0 / jnp.maximum(1.0, jnp.max(jnp.abs(command)) / self.full)"
START = "return Own.of(z=jnp.zeros(3))  # the torques [N m]"
SPEEDS = "6 speeds of each of 1 hosts and 0 of its own"


@pytest.mark.parametrize(
    ("old", "new", "what", "expected", "got"),
    [
        (
            BALANCE,
            "return around.own.z",
            "balance",
            f"float64 of shape (6,), {SPEEDS}",
            "float64 of shape (3,)",
        ),
        (
            RATES,
            "return Rates(around.own.y, -around.own.z[:2] / self.lag)",
            "rates().z",
            "float64 of shape (3,), as start has it",
            "float64 of shape (2,)",
        ),
        (RATES, "return -around.own.z", "rates", "Rates", "float64 of shape (3,)"),
        (
            AUTHORITY,
            "return Authority(around.hosts[0].R_AX, self.full, jnp.full(2, self.full))",
            "authority().full",
            "float64 of shape (3,), one for each of 3 command_names",
            "float64 of shape (2,)",
        ),
        (
            NAMES,
            'return [f"{self.name}_command"]',
            "authority().axes_A",
            "float64 of shape (3, 1), one for each of 1 command_names",
            "float64 of shape (3, 3)",
        ),
        (
            AUTHORITY,
            "raise NotImplementedError",
            "authority",
            "the law to have this method",
            "none",
        ),
        (NAMES, "return 3", "command_names", "a list of str", "3"),
        (
            NAMES,
            'return ["x", "y", "x"]',
            "command_names",
            "names that are all unlike",
            "['x', 'y', 'x']",
        ),
        (SHARE, "return command", "share", "float64 of shape ()", "float64 of shape (3,)"),
        (START, "return jnp.zeros(3)", "start", "Own", "float64 of shape (3,)"),
        (
            START,
            "return Own.of(z=0.0)",
            "start().z",
            "float64 of shape (n,), in a row",
            "float64 of shape ()",
        ),
        (
            START,
            "return Own.of(z=jnp.zeros(3), y=jnp.zeros(2), y_rate=jnp.zeros(1))",
            "start().y_rate",
            "float64 of shape (2,), as y has",
            "float64 of shape (1,)",
        ),
        (
            "def rates(self, around, command):",
            "def energy(self, around):\n        from quietbus.extend import Energy\n"
            "        return Energy(around.own.z, 0.0)\n\n"
            "    def rates(self, around, command):",
            "energy().stored",
            "float64 of shape ()",
            "float64 of shape (3,)",
        ),
        (
            MAKES_RODS,
            MAKES_RODS.replace("name,", "'rod',"),
            "name",
            "'rods', as its builder is given",
            "'rod'",
        ),
        (
            MAKES_RODS,
            MAKES_RODS.replace("(said.on,)", "('panel',)"),
            "hosts",
            "a tuple of some of bus, plate",
            "['panel']",
        ),
        (
            MAKES_RODS,
            MAKES_RODS.replace("(said.on,)", "'bus'"),
            "hosts",
            "a tuple of some of bus, plate",
            "'bus'",
        ),
        (
            NAMES,
            'return ["bus_torque_x", "rod_y", "rod_z"]',
            "command_names",
            "names of their own",
            "'bus_torque_x', which bus has already",
        ),
        (
            NAMES,
            'return [f"gimbal_rate_command_{i}" for i in range(3)]',
            "command_names",
            "names of their own",
            "'gimbal_rate_command_0', which cluster has already",
        ),
        (
            MAKES_RODS,
            MAKES_RODS.replace("said.torque", "-1.0"),
            "authority().torque",
            "what is above 0",
            "-1.0",
        ),
        (
            AUTHORITY,
            "return Authority(around.hosts[0].R_AX, self.full, jnp.array([1.0, 0.0, -1.0]))",
            "authority().full",
            "what is above 0",
            "[1.0, 0.0, -1.0]",
        ),
        (SHARE, "return 2.0", "share", "a number above 0, up to 1, for commands of 0", "2"),
        (
            SHARE,
            "return 1.0 / jnp.max(command)",
            "share",
            "a number above 0, up to 1, for commands of 0",
            "inf",
        ),
        (BALANCE, "return jnp.full(6, jnp.nan)", "balance", FINITE, "nan"),
        (
            RATES,
            "return Rates(around.own.y, jnp.sqrt(command))",
            "rates",
            SMOOTH,
            "nan",
        ),
        (
            BALANCE,
            "return jnp.sqrt(jnp.concatenate([around.own.z, around.own.z]))",
            "balance",
            SMOOTH,
            "nan",
        ),
        (
            RATES,
            "return Rates(around.own.y, command / 0.0)",
            "rates",
            FINITE,
            "nan",
        ),
    ],
)
def test_actuators_that_give_what_they_should_not_are_told(load, old, new, what, expected, got):
    load((old, new))
    assert told() == f"{AT_RODS}TorqueRodsLaw.{what}: expected {expected}, got {got}"


def test_actuators_that_raise_or_are_not_made_are_told(load):
    load((MAKES_RODS, "return said"))
    said = "actuator_of(TorqueRods): expected one of AbstractActuator, got an object of type "
    assert told() == f"{AT_RODS}{said}TorqueRods"
    load(("@actuator_of.register\n", ""))
    said = "TorqueRods: expected a function with @actuator_of.register, got none"
    assert told() == AT_RODS + said
    text = load((BALANCE, "return self.torque")).read_text(encoding="utf-8")
    line = in_line(text, "return self.torque")
    said = f"TorqueRodsLaw.balance: raised AttributeError in own_parts.py, line {line}: "
    assert told().startswith(AT_RODS + said)


@pytest.mark.parametrize(
    ("told_of", "said"),
    [
        ("{'x': 1}", "expected a tuple of Output, got a mapping"),
        ("(Output(TORQUES, self.full),)", "rods: expected numbers over axis, got shape ()"),
    ],
)
def test_actuators_with_a_report_that_is_none_are_told(load, told_of, said):
    report = "    def report(self, around, rates, u_rate, detailed=False):\n        from quietbus "
    report += "import extend\n        from quietbus.extend import Output\n"
    report += '        TORQUES = extend.Quantity("rods", ("axis",), "N m", "of the rods")\n'
    rates = "    def rates(self, around, command):"
    load((rates, f"{report}        return {told_of}\n\n{rates}"))
    assert told() == f"{AT_RODS}TorqueRodsLaw.report: raised TypeError: {said}"


def test_two_actuators_with_the_same_names_of_commands_are_told(load):
    load((NAMES, 'return ["rod_x", "rod_y", "rod_z"]'))
    said = "TorqueRodsLaw.command_names: expected names of their own, got 'rod_x', which rods has "
    two = scenario(actuators={"rods": RODS, "other rods": RODS})
    assert told(two) == f"actuators.other rods: {said}already"
