"""Harmonic tables from files: values against hand computation, and what is wrong with a file."""

import numpy as np
import pytest

import quietbus as qb
from quietbus.scenario import ScenarioError, builtin_text

CSV = """# measured by us
unit, kind, order, coefficient
N/rpm^2, radial_force, 1.0, 8.2e-10
kg*m, radial_force, 2.5, 3e-9
N*m/(rad/s)^2, radial_torque, 1.0, 4.0e-9
g*cm^2, axial_torque, 5.21, 0.7
mN/(rev/s)^2, axial_force, 2.5, 1e-5
"""
WHEEL_42 = """<<<<<<<<<<<<<<  Wheel Drag and Jitter  >>>>>>>>>>>>>>
***********  Drag  ***********
0.02            ! Coulomb Friction, Nm
***********  Jitter  ***********
4.0             ! Wheel Rotor Mass, kg
0.8             ! 2*Jt/Jr Ratio (<1.0)
20.0            ! Phase of Static vs. Dyn Imbalance, deg
210.0  0.03     ! Lateral Mode Freq, Hz, Damping Ratio
70.0   0.05     ! Rocking Mode Freq, Hz, Damping Ratio
0.5             ! Static Imbalance, g-cm (Fundamental)
11.0            ! Dynamic Imbalance, g-cm^2 (Fundamental)
*********** Harmonics ***********
2               ! Number of Harmonics
======== 0 ========
3.0             ! Harmonic Number
0.2             ! Static Imbalance, g-cm
2.0             ! Dynamic Imbalance, g-cm^2
15.0            ! Harmonic Phase Angle, deg
======== 1 ========
0.6             ! Harmonic Number
0.1             ! Static Imbalance, g-cm
0.0             ! Dynamic Imbalance, g-cm^2
-40.0           ! Harmonic Phase Angle, deg
"""
INI = """// a wheel
[WHEEL_JITTER_1]
harmonics_degree = 2 // of three
radial_force_harmonics_coefficient_file = SETTINGS/tables/radial_force_harmonics_coefficients.csv
radial_torque_harmonics_coefficient_file = SETTINGS/tables/radial_torque_harmonics_coefficients.csv
considers_structural_resonance = DISABLE
structural_resonance_frequency_Hz = 410.0
"""
FORCE = "1.0, 9.0E-8\n4.2,2.0e-9\n1.9,1.0e-9\n"
TORQUE = "1.0,3.0e-9\n6.1,1e-10\n1.9,1e-11\n"


@pytest.fixture
def put(tmp_path):
    def write(text, name="wheel.csv"):
        file = tmp_path / name
        file.parent.mkdir(exist_ok=True)
        file.write_text(text)
        return file

    return write


def test_csv_columns_in_any_order_with_any_unit(put):
    table = qb.read_wheel_table(put(CSV))
    assert (table.layout, table.lost) == ("csv", ())
    rpm = 2 * np.pi / 60
    assert [order["order"] for order in table.orders] == [1.0, 2.5, 5.21]
    first, second, third = table.orders
    assert first["radial_force"] == pytest.approx(8.2e-10 / rpm**2)
    assert first["radial_torque"] == pytest.approx(4e-9)
    assert second["radial_force"] == pytest.approx(3e-9)
    assert second["axial_force"] == pytest.approx(1e-8 / (2 * np.pi) ** 2)
    assert third == {"order": 5.21, "axial_torque": pytest.approx(0.7e-7), "phase": "random"}


def test_csv_with_phases_whirl_and_the_unit_beside_the_number(put):
    text = (
        "order;coefficient;phase;whirl\n"
        "1;1 g*cm;30 deg;\n1;2e-3 g*cm;random;backward\n2;3 g*cm;;forward\n"
    )
    table = qb.read_wheel_table(put(text), kind="radial_force")
    assert table.orders == (
        {"order": 1.0, "radial_force": pytest.approx(1e-5), "phase": pytest.approx(np.pi / 6)},
        {"order": 1.0, "radial_force": pytest.approx(2e-8), "whirl": "backward",
         "phase": "random"},
        {"order": 2.0, "radial_force": pytest.approx(3e-5), "phase": "random"},
    )  # fmt: skip


def force_of_42(speed, angle, order, imbalance, phase, natural, damping):
    """Along U and V, as the equations of 42's WheelJitter give it."""
    w = order * speed
    z = natural**2 - w**2 + 2j * damping * natural * w
    rotating = np.exp(1j * order * (angle + phase)) * imbalance * w**2 * (-1 - w**2 / z)
    return rotating.real, rotating.imag


def test_42s_wheel_gives_42s_force(put):
    table = qb.read_wheel_table(put(WHEEL_42, "Whl_Ours.txt"))
    assert table.layout == "42"
    assert table.resonances["radial"] == {"frequency": 210.0, "damping": 0.03}
    assert table.resonances["rocking"] == {"frequency": 70.0, "damping": 0.05}
    assert [order["order"] for order in table.orders] == [0.6, 1.0, 3.0]
    assert any("0.4 of that" in note for note in table.notes)
    assert any("drag" in note for note in table.notes)
    speed, natural, damping = 120.0, 2 * np.pi * 210.0, 0.03
    given = {1.0: (0.5e-5, 0.0), 3.0: (0.2e-5, 15.0), 0.6: (0.1e-5, -40.0)}
    for line in table.orders:
        imbalance, degrees = given[line["order"]]
        phase = np.deg2rad(20.0 + degrees)
        for angle in (0.0, 0.7, 4.0):
            u, v = force_of_42(speed, angle, line["order"], imbalance, phase, natural, damping)
            w = line["order"] * speed
            c = 2j * damping * natural * w
            ours = line["radial_force"] * speed**2 * np.exp(
                1j * (line["order"] * angle + line["phase"]["radial_force"])
            ) * (natural**2 + c) / (natural**2 - w**2 + c)  # fmt: skip
            assert [ours.real, ours.imag] == pytest.approx([u, v], rel=1e-9)
    third = table.orders[2]
    assert third["radial_torque"] == pytest.approx(9 * 2.0e-7)
    assert third["phase"]["radial_torque"] == pytest.approx(np.deg2rad(45.0 - 180.0))


def test_s2es_tables_are_sorted_and_cut_as_its_ini_says(put):
    put(FORCE, "tables/radial_force_harmonics_coefficients.csv")
    put(TORQUE, "tables/radial_torque_harmonics_coefficients.csv")
    table = qb.read_wheel_table(put(INI, "wheel.ini"))
    assert table.layout == "s2e"
    assert table.orders == (
        {"order": 1.0, "radial_force": 9e-8, "radial_torque": 3e-9, "phase": "random"},
        {"order": 4.2, "radial_force": 2e-9, "phase": "random"},
        {"order": 6.1, "radial_torque": 1e-10, "phase": "random"},
    )
    alone = qb.read_wheel_table(put(FORCE, "our_radial_force.csv"))
    assert [order["order"] for order in alone.orders] == [1.0, 1.9, 4.2]
    assert qb.read_wheel_table(put(FORCE), kind="axial_force").orders[0]["axial_force"] == 9e-8
    resonant = qb.read_wheel_table(put(INI.replace("DISABLE", "ENABLE"), "wheel.ini"))
    assert "410.0 Hz" in resonant.lost[0]


@pytest.mark.parametrize(
    ("text", "message"),
    [
        ("", "expected a table, got an empty file"),
        ("# only\n", "expected a table: rows of numbers"),
        ("order,kind,coefficient,unit\n", "expected rows below the header, got none"),
        ("order,coefficient,unit\n1,1,N\n", "line 1: expected a column 'kind'"),
        ("order,kind,coefficient,size\n1,radial_force,1,2\n", "unknown column 'size'"),
        ("order,kind,coefficient\n1,radial_force,1e-8\n", r"coefficient \(line 2\): .* got none"),
        ("order,kind,coefficient,unit\n1,radial_force,1e-8,N\n", r"line 2.*a force\?"),
        ("order,kind,coefficient,unit\n1,radial_force,1e-8,kg*m^2\n", "a moment of inertia"),
        ("order,kind,coefficient,unit\n1,radial_torque,1,N*m/Hz^2\n", "turns or radians"),
        ("order,kind,coefficient,unit\n1,radial_force,-1,kg*m\n", "must be at least 0"),
        ("order,kind,coefficient,unit\n-1,radial_force,1,kg*m\n", "must be above 0"),
        ("order,kind,coefficient,unit\n1,radial,1,kg*m\n", r"kind \(line 2\).*got 'radial'"),
        ("order,kind,coefficient,unit\n1,radial_force,1\n", "expected 4 cells, got 3"),
        (
            "order,kind,coefficient,unit\n2,radial_force,1,kg*m\n1,radial_force,1,kg*m\n",
            r"order \(line 3\): expected an order above 2, the one before of radial_force, got 1",
        ),
        ("order,kind,coefficient,unit,phase\n1,radial_force,1,kg*m,1 s\n", "phase"),
        ("1,2e-8\n", "expected the file's name to say its kind"),
    ],
)
def test_a_wrong_csv_is_told_with_line_and_column(put, text, message):
    file = put(text)
    with pytest.raises(ScenarioError, match=message) as raised:
        qb.read_wheel_table(file)
    assert str(raised.value).startswith(str(file))


@pytest.mark.parametrize(
    ("old", "new", "message"),
    [
        ("2               ! Number", "3   ! Number", r"as many as the number says \(3\), got 8"),
        ("0.2             ! Static", "-0.2  ! Static", r"static imbalance \(line 16\).*at least 0"),
        ("3.0             ! Harmonic", "1.0  ! Harmonic", "stands in line 10 already"),
        ("70.0   0.05     ! Rock", "70.0 ! Rock", "expected frequency and damping, got 1"),
        ("! Lateral Mode Freq", "! Mode", "expected a line '... ! lateral mode'"),
        ("! Number of Harmonics", "", "Number of Harmonics"),
        ("0.8             ! 2*Jt", "x ! 2*Jt", "a ratio of inertias"),
    ],
)
def test_a_wrong_42_file_is_told(put, old, new, message):
    assert WHEEL_42.count(old) == 1
    with pytest.raises(ScenarioError, match=message):
        qb.read_wheel_table(put(WHEEL_42.replace(old, new), "Whl.txt"))


def test_a_wrong_s2e_file_is_told(put):
    put(FORCE, "tables/radial_force_harmonics_coefficients.csv")
    with pytest.raises(ScenarioError, match=r"radial_torque.*no such file"):
        qb.read_wheel_table(put(INI, "wheel.ini"))
    put(TORQUE, "tables/radial_torque_harmonics_coefficients.csv")
    with pytest.raises(ScenarioError, match="expected 7 rows, as harmonics_degree says, got 3"):
        qb.read_wheel_table(put(INI.replace("= 2", "= 7"), "wheel.ini"))
    with pytest.raises(ScenarioError, match="harmonics_degree: expected a count"):
        qb.read_wheel_table(put(INI.replace("= 2", "= two"), "wheel.ini"))
    with pytest.raises(ScenarioError, match=r"line 2.*must be at least 0"):
        qb.read_wheel_table(put("1,1e-8\n2,-1e-9\n", "radial_force.csv"))
    with pytest.raises(ScenarioError, match="order 2 of radial_force stands in line 1 already"):
        qb.read_wheel_table(put("2,1e-8\n2,1e-9\n", "radial_force.csv"))
    with pytest.raises(ScenarioError, match="no such file"):
        qb.read_wheel_table("nowhere.csv")
    with pytest.raises(ValueError, match="kind: expected one of"):
        qb.read_wheel_table("nowhere.csv", kind="radial")


def scenario_with(table, put, extra=""):
    text = builtin_text("zhang2012")
    at = text.index("    rotor:\n") if "    rotor:\n" in text else text.index("  rotor:\n")
    line = text[at:].splitlines()[0]
    deeper = " " * (len(line) - len(line.lstrip()) + 2)
    block = f"{line}\n{deeper}disturbance:\n{deeper}  table: {table}\n{extra}"
    return put(text[:at] + block + text[at + len(line) + 1 :], "satellite.yaml")


def test_a_scenario_names_a_table_beside_it(put, tmp_path, monkeypatch):
    put(WHEEL_42, "Whl.txt")
    file = scenario_with("Whl.txt", put)
    monkeypatch.chdir("/")
    scenario = qb.load_scenario(file)
    found = scenario.cluster.rotor.disturbance
    assert [line.order for line in found.orders] == [0.6, 1.0, 3.0]
    assert found.resonances.rocking.frequency == 70.0
    assert found.table is None
    assert qb.Scenario.from_yaml(scenario.to_yaml()) == scenario  # whole without the file
    by_hand = qb.Scenario.from_dict(
        scenario.to_dict()
        | {"cluster": scenario.to_dict()["cluster"] | {
            "rotor": scenario.to_dict()["cluster"]["rotor"]
            | {"disturbance": qb.read_wheel_table(tmp_path / "Whl.txt").to_dict()}}}
    )  # fmt: skip
    assert by_hand == scenario
    assert "order: 0.6" in qb.read_wheel_table(tmp_path / "Whl.txt").to_yaml()


@pytest.mark.parametrize(
    ("table", "message"),
    [
        ("nowhere.csv", r"cluster\.rotor\.disturbance\.table \(line \d+\): .*nowhere.csv: no such"),
        ("bad.csv", r"bad.csv: coefficient \(line 2\): .*got '1 N'"),
        ("wheel.ini", "cannot be taken over: structural resonance"),
        ("[1]", "expected the name of a file"),
    ],
)
def test_a_wrong_table_is_told_by_the_scenarios_field_and_the_tables_line(put, table, message):
    put("order,kind,coefficient,unit\n1,radial_force,1,N\n", "bad.csv")
    put(INI.replace("DISABLE", "ENABLE"), "wheel.ini")
    put(FORCE, "tables/radial_force_harmonics_coefficients.csv")
    put(TORQUE, "tables/radial_torque_harmonics_coefficients.csv")
    with pytest.raises(ScenarioError, match=message):
        qb.load_scenario(scenario_with(table, put))
