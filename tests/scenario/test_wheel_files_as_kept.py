"""Harmonic tables as people keep them: wheels in one file, commas, tabs, old names, damage."""

import random
import time

import pytest
from typer.testing import CliRunner

import quietbus as qb
from quietbus.build import build_satellite
from quietbus.cli.app import app
from quietbus.scenario import Scenario, ScenarioError, builtin_text

from .test_wheel_files import CSV, FORCE, INI, TORQUE, WHEEL_42

ONE = ({"order": 1.0, "radial_force": 2e-7, "radial_torque": 6e-9, "phase": "random"},)
WHEELS = """// all wheels
[WHEEL_A]
radial_force_harmonics_coefficient_file = radial_force_a.csv
radial_torque_harmonics_coefficient_file = radial_torque_a.csv
harmonics_degree = 1

[POWER_PORT]
minimum_voltage_V = 3.3 // V
[WHEEL_B]
radial_force_harmonics_coefficient_file = radial_force_b.csv
radial_torque_harmonics_coefficient_file = radial_torque_a.csv
harmonics_degree = 1
"""


@pytest.fixture
def put(tmp_path):
    def write(text, name):
        file = tmp_path / name
        file.parent.mkdir(exist_ok=True)
        file.write_text(text)
        return file

    write("1.0,2e-7\n", "radial_force_a.csv")
    write("1.0,6e-9\n", "radial_torque_a.csv")
    return write


def test_wheels_that_agree_are_one_and_others_are_chosen_by_section(put):
    put("1.0,2.0e-7 // the same\n", "radial_force_b.csv")
    file = put(WHEELS, "wheels.ini")
    table = qb.read_wheel_table(file)
    assert table.orders == ONE
    assert any("WHEEL_A, WHEEL_B, which agree" in note for note in table.notes)
    put("1.0,3e-7\n", "radial_force_b.csv")
    with pytest.raises(ScenarioError, match="to be one of WHEEL_A, WHEEL_B, whose tables differ"):
        qb.read_wheel_table(file)
    assert qb.read_wheel_table(file, wheel="WHEEL_A").orders == ONE
    assert qb.read_wheel_table(file, wheel="WHEEL_B").orders[0]["radial_force"] == 3e-7
    with pytest.raises(ScenarioError, match="to be one of WHEEL_A, WHEEL_B, got 'wheel_a'"):
        qb.read_wheel_table(file, wheel="wheel_a")
    with pytest.raises(ScenarioError, match="expected an ini file for --wheel"):
        qb.read_wheel_table(file.with_name("radial_force_a.csv"), wheel="WHEEL_A")


def test_key_names_from_before_their_renaming(put):
    old = """[RW1]
calculation = DISABLE
radial_force_harmonics_coef_path = ../../data/ini/RWDisturbance/radial_force_a.csv
radial_torque_harmonics_coef_path = ..\\data\\radial_torque_a.csv
harmonics_degree = 1
considers_structural_resonance = ENABLE
structural_resonance_freq = 585.0 //[Hz]
"""
    table = qb.read_wheel_table(put(old, "old.ini"))
    assert table.orders == ONE
    assert "585.0 Hz" in table.lost[0]
    assert any("switched off in S2E" in note for note in table.notes)


def test_force_and_torque_given_together(put, tmp_path):
    files = [tmp_path / "radial_force_a.csv", tmp_path / "radial_torque_a.csv"]
    assert qb.read_wheel_table(files).orders == ONE
    with_header = put("order,kind,coefficient,unit\n1,axial_force,3e-9,kg*m\n", "axial.csv")
    both = qb.read_wheel_table([files[0], with_header])
    assert both.orders == (
        {"order": 1.0, "radial_force": 2e-7, "axial_force": 3e-9, "phase": "random"},
    )
    with pytest.raises(ScenarioError, match=r"stands in line 1 of radial_force_a\.csv already"):
        qb.read_wheel_table([files[0], put("1,1e-9\n", "our_radial_force.csv")])
    with pytest.raises(ScenarioError, match="a file of 42 or an ini stands alone"):
        qb.read_wheel_table([files[0], put(WHEEL_42, "Whl.txt")])
    with pytest.raises(ValueError, match="expected none for several files"):
        qb.read_wheel_table(files, kind="radial_force")
    with pytest.raises(ValueError, match="expected a file or several"):
        qb.read_wheel_table([])
    done = CliRunner().invoke(app, ["import", *map(str, files)])
    assert done.exit_code == 0
    assert "{order: 1.0, radial_force: 2e-07, radial_torque: 6e-09, phase: random}" in done.stdout


def test_a_scenario_names_both_tables(put, tmp_path):
    data = Scenario.from_yaml(builtin_text("zhang2012")).to_dict()
    names = ["radial_force_a.csv", "radial_torque_a.csv"]
    data["cluster"]["rotor"]["disturbance"] = {"table": [str(tmp_path / name) for name in names]}
    (order,) = Scenario.from_dict(data).cluster.rotor.disturbance.orders
    assert (order.radial_force, order.radial_torque) == (2e-7, 6e-9)


@pytest.mark.parametrize(
    "text",
    [
        "// measured by us\n1.0, 9.0E-8\n4.2,2.0e-9\n",
        "# measured by us\n1,0;9,0E-8\n4,2;2,0e-9\n",
        "1.0\t9.0E-8\n4.2\t2.0e-9\n",
        "1,0\t9,0E-8\n4,2\t2,0e-9\n",
        "1.0,\t9.0E-8\n4.2,\t2.0e-9\n",
        "1.0 9.0E-8\n4.2   2.0e-9\n",
        "1,0  9,0E-8\n4,2 2,0e-9\n",
        "1; 9E-8\n4,2; 2e-9 // torn\n",
    ],
)
def test_separators_and_decimal_commas_without_a_header(put, text):
    table = qb.read_wheel_table(put(text, "our_Radial_Force.csv"))
    assert [(o["order"], o["radial_force"]) for o in table.orders] == [(1.0, 9e-8), (4.2, 2e-9)]
    commas = ";" in text or "1,0" in text
    assert any("decimal commas" in note for note in table.notes) == commas


@pytest.mark.parametrize(
    "text",
    [
        "order;kind;coefficient\n1,0;radial_force;1,36 g*cm\n2,5;radial_force;0,2 g*cm\n",
        "order\tkind\tcoefficient\tunit\n1\tradial_force\t1.36\tg*cm\n2.5\tradial_force\t.2\tg*cm\n",
        "order\tcoefficient\tunit\tkind\n1\t1,36\tg*cm\tradial_force\n2,5\t0,2\tg*cm\tradial_force\n",
        "// by us\norder, kind, coefficient, unit\n1, radial_force, 1.36, g*cm\n"
        "2.5, radial_force, 0.2, g*cm\n",
    ],
)
def test_separators_and_decimal_commas_with_a_header(put, text):
    table = qb.read_wheel_table(put(text, "wheel.csv"))
    assert [o["order"] for o in table.orders] == [1.0, 2.5]
    assert [o["radial_force"] for o in table.orders] == pytest.approx([1.36e-5, 2e-6])


def test_a_comma_beside_a_point_is_asked_about(put):
    with pytest.raises(ScenarioError, match=r"decimal sign\? '9,0E-8' stands in line 1, '1.0'"):
        qb.read_wheel_table(put("1.0;9,0E-8\n", "radial_force.csv"))
    with pytest.raises(ScenarioError, match="expected two cells, order and coefficient, got 4"):
        qb.read_wheel_table(put("1,0,9,0E-8\n", "radial_force.csv"))


def test_42_with_decimal_commas_and_tabs(put):
    values, labels = [], []
    for line in WHEEL_42.splitlines():
        value, mark, label = line.partition("!")
        values.append(value.replace(".", ",").replace(" ", "\t") if mark else value)
        labels.append(mark + label)
    text = "\n".join(value + label for value, label in zip(values, labels, strict=True))
    ours = qb.read_wheel_table(put(text, "Whl_comma.txt"))
    plain = qb.read_wheel_table(put(WHEEL_42, "Whl.txt"))
    assert (ours.orders, ours.resonances) == (plain.orders, plain.resonances)
    assert "decimal commas" in ours.notes[-1]
    assert "decimal commas" not in plain.notes[-1]


@pytest.mark.parametrize(
    ("name", "text", "message"),
    [
        ("w.ini", "[w]\nradial_force_harmonics_coefficient_file =\nharmonics_degree = 3\n",
         "w: radial_force_harmonics_coefficient_file: expected the name of a file, got nothing"),
        ("w.ini", INI.replace("= 2 ", "= ² "), "harmonics_degree: expected a count"),
        ("w.ini", INI + INI, r"line 9: 'WHEEL_JITTER_1' stands in the file twice"),
        ("w.ini", "[w]\na = 1\na = 2\n", r"line 3: 'a' stands in the file twice"),
        ("w.ini", "[w]\nwords alone\n", r"line 2: not an ini file: expected \[section\]"),
        ("w.ini", "a = 1\n", r"line 1: not an ini file"),
        ("w.ini", "[w]\na = 1\n", "expected a section with radial_force_harmonics"),
        ("w.ini", INI.replace("SETTINGS/tables", "/etc/").replace("SETTINGS", "../.."),
         "no such file"),
        ("radial_force_radial_torque.csv", "1,1\n", "expected the file's name to say its kind"),
        ("radial_force.csv", "// nothing but words\n", "expected a table: rows of numbers"),
        ("radial_force.csv", "1" * 200_000 + ";1\n", "not a finite number|cannot be parted"),
    ],
)  # fmt: skip
def test_a_file_that_is_wrong_is_told_in_one_message(put, name, text, message):
    with pytest.raises(ScenarioError, match=message):
        qb.read_wheel_table(put(text, name))


def test_huge_numbers_and_superscripts_in_42s_file_are_told(put):
    huge = WHEEL_42.replace("3.0             ! Harm", "1e300 ! Harm")
    with pytest.raises(ScenarioError, match=r"harmonic number \(line 15\).*too large"):
        qb.read_wheel_table(put(huge, "Whl.txt"))
    many = WHEEL_42.replace("2               ! Number", "² ! Number")
    with pytest.raises(ScenarioError, match=r"as many as the number says \(²\), got 8"):
        qb.read_wheel_table(put(many, "Whl.txt"))


def test_a_path_in_an_ini_does_not_leave_its_folder(put, tmp_path):
    put("1.0,5e-7\n", "radial_force_outside.csv")
    inside = put(
        WHEELS.replace("radial_force_a", "../radial_force_outside").replace("A]", "A]\n", 1),
        "inside/wheels.ini",
    )
    with pytest.raises(ScenarioError, match=r"inside/radial_force_outside.csv: no such file"):
        qb.read_wheel_table(inside, wheel="WHEEL_A")


def test_rows_beyond_harmonics_degree_are_told(put):
    put(FORCE, "tables/radial_force_harmonics_coefficients.csv")
    put(TORQUE, "tables/radial_torque_harmonics_coefficients.csv")
    notes = qb.read_wheel_table(put(INI, "wheel.ini")).notes
    assert sum("the first 2 of 3 rows are taken" in note for note in notes) == 2


def test_of_many_problems_the_first_are_told(put):
    text = "order,kind,coefficient,unit\n" + "1,radial_force,x,kg*m\n" * 1000
    with pytest.raises(ScenarioError) as raised:
        qb.read_wheel_table(put(text, "wheel.csv"))
    assert "and 995 problems more" in str(raised.value)
    assert len(str(raised.value).splitlines()) == 6


def test_reading_takes_a_time_linear_in_the_rows(put):
    def taken(rows):
        text = "order,kind,coefficient,unit\n" + "".join(
            f"{1 + 0.01 * i:.2f},radial_force,1e-9,kg*m\n" for i in range(rows)
        )
        file = put(text, "long.csv")
        start = time.process_time()
        assert len(qb.read_wheel_table(file).orders) == rows
        return time.process_time() - start

    taken(10)  # units are made once
    assert min(taken(20_000) for _ in range(3)) < 40 * taken(1000) + 0.2


def test_building_takes_a_time_linear_in_the_orders():
    data = Scenario.from_yaml(builtin_text("zhang2012")).to_dict()

    def taken(count):
        orders = [{"order": 1 + 0.01 * i, "radial_force": 1e-9} for i in range(count)]
        data["cluster"]["rotor"]["disturbance"] = {"orders": orders}
        scenario = Scenario.from_dict(data)
        start = time.process_time()
        assert len(build_satellite(scenario).clusters[0].disturbance.order) >= count
        return time.process_time() - start

    taken(10)
    assert min(taken(8000) for _ in range(3)) < 40 * taken(400) + 0.2


def test_damaged_files_never_end_in_a_traceback(put):
    draw = random.Random(7)
    pieces = ["", "!", ",", ";", "\t", "[", "]", "=", "²", "1e309", "-1", "nan", '"', "//", "\x00",
              "1_0", "0", " ", "é", "\n", "9" * 400]  # fmt: skip
    for name, text in (
        ("Whl.txt", WHEEL_42), ("wheel.csv", CSV), ("radial_force.csv", FORCE), ("w.ini", WHEELS)
    ):  # fmt: skip
        for _ in range(60):
            damaged = text
            for _ in range(draw.randint(1, 3)):
                i = draw.randrange(len(damaged))
                damaged = damaged[:i] + draw.choice(pieces) + damaged[i + draw.randint(0, 9) :]
            try:
                table = qb.read_wheel_table(put(damaged or " ", name))
            except ScenarioError:
                continue
            assert all(0.0 < order["order"] < float("inf") for order in table.orders)
