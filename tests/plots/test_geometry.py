"""Drawings of a scenario: everything stands where the scenario says, and nothing is compiled."""

import subprocess
import sys
import warnings

import numpy as np
import pytest
from matplotlib.backends.backend_agg import FigureCanvasAgg
from scipy.spatial.transform import Rotation

from quietbus.build import build_satellite
from quietbus.plots.geometry import geometry_figures
from quietbus.plots.layout import layout
from quietbus.plots.pane import Plane
from quietbus.plots.style import new_figure
from quietbus.scenario import builtin_names, load_scenario

ANGLES = [0.35, -0.6, 1.2, 0.1]
TILTED = load_scenario("zhang2012").with_overrides(
    {
        "isolator.orientation": [0.5, 0.35, -0.2],
        "isolator.offset": [0.4, -0.3, 0.8],
        "isolator.mount": "rigid",
        "cluster.gimbal_angles": ANGLES,
        "lines_of_sight": {"camera $x": {"direction": [0, 0, -1]}},
        "name": r"$\frac{1$ [/red]",
    }
)


def test_parts_stand_where_the_model_has_them():
    """Oracle: the model that is built for a run, by other code."""
    placed, built = layout(TILTED), build_satellite(TILTED)
    (mount,), (legs,) = built.mounts, built.hexapods
    R_BP = Rotation.from_quat(np.asarray(mount.q_BX), scalar_first=True).as_matrix()
    np.testing.assert_allclose(placed.R_BD, R_BP, atol=1e-12)
    np.testing.assert_allclose(placed.p_BP_B, mount.p_BX_B, atol=1e-12)
    np.testing.assert_allclose(placed.lower_B, legs.geometry.p_BA_B, atol=1e-12)
    upper = np.asarray(mount.p_BX_B) + np.asarray(legs.geometry.p_PU_P) @ R_BP.T
    np.testing.assert_allclose(placed.upper_B, upper, atol=1e-12)
    np.testing.assert_allclose(placed.axes_B, legs.geometry.k_B, atol=1e-12)


def test_momentum_turns_with_the_gimbals():
    """Oracle: SciPy's rotations, and 15 N m s of each rotor."""
    placed = layout(TILTED)
    base = Rotation.from_euler("ZYX", [-0.2, 0.35, 0.5])
    for unit, drawn, angle in zip(TILTED.cluster.placed(), placed.units, ANGLES, strict=True):
        turned = Rotation.from_rotvec(angle * np.array(unit.gimbal_axis)).apply(unit.spin_axis)
        np.testing.assert_allclose(drawn.momentum, 15.0 * base.apply(turned), atol=1e-12)
    assert layout(load_scenario("zhang2012")).total_momentum == pytest.approx(0.0, abs=1e-12)


def test_cuboid_has_mass_and_inertia_of_the_bus():
    """Oracle: second moments; those of a solid cuboid are a third of its corners'."""
    bus = TILTED.bus
    corners = layout(TILTED).corners_B
    second = bus.mass * corners.T @ corners / 8 / 3
    inertia = np.trace(second) * np.eye(3) - second
    np.testing.assert_allclose(inertia, np.array(bus.inertia), rtol=1e-12, atol=1e-9)


@pytest.fixture(scope="module", params=[*builtin_names(), "tilted"])
def figures(request):
    scenario = TILTED if request.param == "tilted" else load_scenario(request.param)
    with warnings.catch_warnings():
        warnings.simplefilter("error")
        made = geometry_figures(scenario)
        for figure in made.values():
            figure.draw_without_rendering()
    return made


def test_every_view_is_drawn_with_units_on_its_axes(figures):
    assert list(figures) == ["platform", "satellite", "frames", "leg", "units"]
    assert len(figures["platform"].axes) == 4
    for axes in figures["platform"].axes + figures["units"].axes:
        assert axes.get_xlabel().endswith("[m]")
        assert axes.get_ylabel().endswith("[m]")
    legend = [text.get_text() for text in figures["platform"].legends[0].get_texts()]
    assert any("N m s" in text for text in legend)
    assert any("legs" in text for text in legend)


def test_no_two_words_lie_on_each_other(figures):
    for name in ("platform", "units"):
        figure = figures[name]
        renderer = FigureCanvasAgg(figure).get_renderer()
        for axes in figure.axes:
            if axes.name == "3d":
                continue
            boxes = [
                (text.get_text(), text.get_window_extent(renderer))
                for text in axes.texts
                if text.get_text()
            ]
            for i, (a, one) in enumerate(boxes):
                for b, other in boxes[:i]:
                    width = min(one.x1, other.x1) - max(one.x0, other.x0)
                    height = min(one.y1, other.y1) - max(one.y0, other.y0)
                    overlap = max(width, 0.0) * max(height, 0.0)
                    smaller = min(one.width * one.height, other.width * other.height)
                    assert overlap < 0.25 * smaller, f"{name}: {a} on {b}"


def test_words_at_one_place_are_one():
    axes = new_figure(2.0, "x").subplots()
    pane = Plane(axes, 1.0, 0, 1)
    for leg, z in ((0, 0.0), (3, 0.5), (4, 0.9)):
        pane.label([0.2, 0.3, z], f"leg {leg}")
    pane.finish(np.zeros(3))
    assert [text.get_text() for text in axes.texts] == ["leg 0, 3, 4"]


def test_a_scenario_is_drawn_from_the_command_line_without_jax(tmp_path):
    script = (
        "import sys; from quietbus.cli import main\n"
        "sys.argv = ['quietbus', 'plot', 'zhang2012', '-o', sys.argv[1], '--format', 'svg']\n"
        "try:\n    main()\n"
        "except SystemExit as end:\n"
        "    raise SystemExit((end.code or 0) + 10 * ('jax' in sys.modules))\n"
    )
    command = [sys.executable, "-c", script, str(tmp_path)]
    assert subprocess.run(command, timeout=120).returncode == 0
    names = {"platform.svg", "satellite.svg", "frames.svg", "leg.svg", "units.svg"}
    assert {path.name for path in tmp_path.iterdir()} == names
