"""What else could stand for the isolator: six decoupled low-pass filters."""

from collections.abc import Sequence

import jax.numpy as jnp
import numpy as np
from matplotlib.axes import Axes

from quietbus.analysis.jitter.filters import (
    FilteredJitter,
    HeldPlatform,
    filtered_jitter_of_designs,
    platform_at_rest,
)
from quietbus.build import build_satellite
from quietbus.model.satellite import Satellite
from quietbus.model.variants import with_rotor_speed
from quietbus.plots.style import COLOURS, DASHES, new_figure, share_legend
from quietbus.reproduce.parts import Findings
from quietbus.reproduce.zhang2012.bench import Bench
from quietbus.scenario import Scenario
from quietbus.studies.linear import at_height

GOOD = 0.1  # [-] what counts as good enough
SPEEDS = 2.0 * np.pi * np.geomspace(0.5, 200.0, 64)  # [rad/s] of the rotors
HEIGHTS = np.linspace(0.0, 2.0, 21)  # [m] of the plate over the bus mass centre
CENTRES = np.linspace(-0.4, 0.2, 25)  # [m] of the platform's mass centre over its upper joints
LEG_MASSES = np.linspace(0.0, 4.0, 9)  # [kg] of a leg
MOMENTA = np.geomspace(1.0, 60.0, 7)  # [N m s] of a rotor
DRAWS = 32  # of gimbal angles
MODELS = (  # name in FilteredJitter, label
    ("full", "isolator, full model"),
    ("filters", "six filters (c s + k)"),
    ("springs", "six filters (k)"),
    ("rigid", "no isolator"),
)
MICRO = 1e6 * 180.0 / np.pi  # [1e-6 deg] of 1 rad


def filters(bench: Bench) -> Findings:
    """Six decoupled second-order low-pass filters against the full model."""
    scenario = bench.study.scenario.with_overrides({"control": "none"})
    satellite = build_satellite(scenario)
    still = np.zeros(scenario.units.count)
    bench.shop.tell("filters over rotor speed", 0.1)
    sweep = filtered_jitter_of_designs([_at_speed(satellite, w) for w in SPEEDS], still)
    own = filtered_jitter_of_designs([satellite], still)
    platform = platform_at_rest(satellite, still)
    hz = SPEEDS / (2.0 * np.pi)

    figure = new_figure(6.0, "Six decoupled low-pass filters instead of the isolator's model")
    grid = figure.add_gridspec(2, 4, height_ratios=(1.2, 1.0))
    over_speed = [figure.add_subplot(grid[0, :2]), figure.add_subplot(grid[0, 2:])]
    for axes, axis in zip(over_speed, (0, 2), strict=True):
        for (name, label), colour, dashes in zip(MODELS, (6, 0, 1, 2), DASHES, strict=True):
            size = MICRO * _rss(getattr(sweep, name))[:, axis]
            axes.plot(60.0 * hz, size, color=COLOURS[colour], linestyle=dashes, label=label)
        axes.set(xscale="log", yscale="log", xlabel="rotor speed [rpm]")
        axes.set_title(f"about {'xyz'[axis]}")
    over_speed[0].set_ylabel("bus rate, RSS [10⁻⁶ deg/s]")
    share_legend(figure, over_speed[0])

    bench.shop.tell("filters over the platform's design", 0.5)
    cases: tuple[tuple[str, np.ndarray, list[Satellite], float], ...] = (
        (
            "platform's height\nover the bus [m]",
            HEIGHTS,
            [at_height(satellite, z) for z in HEIGHTS],
            float(satellite.mounts[0].p_BX_B[2]),
        ),
        (
            "its mass centre over\nthe upper joints [m]",
            CENTRES,
            [build_satellite(with_mass_centre(scenario, z)) for z in CENTRES],
            0.0,
        ),
        (
            "mass of a leg [kg]",
            LEG_MASSES,
            [build_satellite(_leg_mass(scenario, m)) for m in LEG_MASSES],
            0.5,
        ),
    )
    panels = [figure.add_subplot(grid[1, k]) for k in range(4)]
    found = []
    for axes, (label, values, designs, here) in zip(panels[:3], cases, strict=True):
        jitter = filtered_jitter_of_designs(designs, still)
        found.append(jitter)
        _draw(axes, values, jitter.error("filters"))
        axes.axvline(here, color="0.6", linewidth=1.0, linestyle=":")
        axes.set_xlabel(label)
    turned = _over_momentum(scenario)
    momentum = panels[3]
    for i in range(3):
        low, middle, high = np.quantile(turned[:, :, i], [0.05, 0.5, 0.95], axis=1)
        momentum.fill_between(MOMENTA, low, high, color=COLOURS[i], alpha=0.15, linewidth=0.0)
        momentum.plot(MOMENTA, middle, color=COLOURS[i], linestyle=DASHES[i])
    momentum.axvline(15.0, color="0.6", linewidth=1.0, linestyle=":")
    momentum.set(xscale="log", xlabel="rotor momentum\n[N m s]")
    for axes in panels:
        axes.axhspan(5e-3, GOOD, color="0.9", zorder=0)
        axes.set(yscale="log", ylim=(5e-3, 10.0))
        if axes is not panels[0]:
            axes.tick_params(labelleft=False)
    panels[0].set_ylabel("error of the filters,\n6000 rpm [-]")
    panels[1].legend(
        *panels[0].get_legend_handles_labels(),
        loc="upper left",
        ncols=3,
        fontsize=8,
        handlelength=1.6,
        columnspacing=0.8,
    )
    numbers = _filter_numbers(sweep, own, platform, found, turned, hz)
    return Findings(figure, _filter_caption(numbers), numbers, _filter_text(numbers))


def _rss(rate: np.ndarray) -> np.ndarray:
    """Root sum of squares over rotors and orders: (..., axis) from (..., cmg, order, axis)."""
    return np.sqrt(np.sum(np.abs(rate) ** 2, axis=(-3, -2)))


def _at_speed(satellite: Satellite, speed: float) -> Satellite:
    """All rotors at another speed [rad/s]; their inertia stays, so momentum goes with speed."""
    return with_rotor_speed(satellite, jnp.full(satellite.count, speed))


def with_mass_centre(scenario: Scenario, height: float) -> Scenario:
    """Plate and CMGs of a scenario moved to ``height`` [m] over the upper joints."""
    changes: dict[str, object] = {"isolator.plate.center_of_mass": [0.0, 0.0, height]}
    if scenario.units.blocks[0].pyramid is not None:
        changes["cluster.pyramid.height"] = height
    for j, unit in enumerate(scenario.to_dict()["cluster"].get("units", ())):
        changes[f"cluster.units[{j}].position"] = [*unit["position"][:2], height]
    return scenario.with_overrides(changes)


def _leg_mass(scenario: Scenario, mass: float) -> Scenario:
    part = scenario.isolator.legs.upper_part
    assert not isinstance(part, tuple)  # one for all legs in the paper
    factor = 0.5 * mass / part.mass
    values = {
        "mass": 0.5 * mass,
        "distance": part.distance,
        "transverse_inertia": factor * part.transverse_inertia,
        "axial_inertia": factor * part.axial_inertia,
    }
    return scenario.with_overrides(
        {f"isolator.legs.{which}_part": values for which in ("upper", "lower")}
    )


def _over_momentum(scenario: Scenario) -> np.ndarray:
    """Errors (momentum, draw, axis) of the filters at gimbal angles drawn at random."""
    count = scenario.units.count
    angles = np.random.default_rng(2012).uniform(-np.pi, np.pi, (DRAWS, count))
    designs = []
    for momentum in MOMENTA:
        spin = momentum / scenario.number("cluster.rotor.speed")
        changes = {
            "cluster.rotor.momentum": momentum,
            "cluster.rotor.transverse_inertia": 0.6 * spin,
        }
        designs += [build_satellite(scenario.with_overrides(changes))] * DRAWS
    jitter = filtered_jitter_of_designs(designs, np.tile(angles, (len(MOMENTA), 1)))
    return jitter.error("filters").reshape(len(MOMENTA), DRAWS, 3)


def _draw(axes: Axes, values: np.ndarray, errors: np.ndarray) -> None:
    for i, axis in enumerate("xyz"):
        axes.plot(values, errors[:, i], color=COLOURS[i], linestyle=DASHES[i], label=axis)


def _filter_numbers(
    sweep: FilteredJitter,
    own: FilteredJitter,
    platform: HeldPlatform,
    found: Sequence[FilteredJitter],
    turned: np.ndarray,
    hz: np.ndarray,
) -> dict[str, float]:
    ratio, error = sweep.ratio("filters"), sweep.error("filters")
    numbers: dict[str, float] = {}
    for i, axis in enumerate("xyz"):
        for kind in ("filters", "springs", "coupled"):
            numbers[f"{kind}_{axis}"] = float(own.ratio(kind)[0, i])
            numbers[f"{kind}_{axis}_error"] = float(own.error(kind)[0, i])
        peak = int(np.argmax(ratio[:, i]))
        numbers[f"filters_{axis}_peak"] = float(ratio[peak, i])
        numbers[f"filters_{axis}_peak_hz"] = float(hz[peak])
        off = np.flatnonzero(error[:, i] > GOOD)
        numbers[f"filters_{axis}_off_from_hz"] = float(hz[off[0]])
        numbers[f"filters_{axis}_off_to_hz"] = float(hz[off[-1]])
        numbers[f"filters_{axis}_worst_error"] = float(error[:, i].max())
        numbers[f"filter_frequency_{axis}"] = float(platform.frequency_hz[i])
        numbers[f"filter_frequency_about_{axis}"] = float(platform.frequency_hz[3 + i])
    by_height, by_centre, by_leg_mass = (jitter.error("filters") for jitter in found)
    centred = int(np.argmin(by_centre[:, :2].max(axis=1)))
    numbers |= {
        "filters_centre": float(CENTRES[centred]),
        "filters_centred_error": float(by_centre[centred, :2].max()),
        "filters_height_error_low": float(by_height[:, :2].min()),
        "filters_height_error_high": float(by_height[:, :2].max()),
        "filters_leg_mass_error_z": float(by_leg_mass[-1, 2]),
        "filters_turned_error_low": float(np.quantile(turned[:, :, :2], 0.05)),
        "filters_turned_error_high": float(np.quantile(turned[:, :, :2], 0.95)),
        "filters_turned_error_z_high": float(np.quantile(turned[:, :, 2], 0.95)),
        "coupled_worst_error": float(sweep.error("coupled").max()),
    }
    return numbers


def _filter_text(n: dict[str, float]) -> str:
    return (
        "Finite-element jitter budgets often have no isolator in the structure. Each of the CMGs' "
        "three forces and three torques, about the platform's mass centre, goes through its own "
        "second-order low-pass and acts on the satellite as if the platform were bolted to it "
        "(the paper's introduction names Gary et al. 1998, Meza et al. 2005). Frequency and "
        "damping are those of one freedom of the platform on a held bus: "
        f"{n['filter_frequency_x']:.2f} Hz for forces, {n['filter_frequency_about_x']:.2f}, "
        f"{n['filter_frequency_about_y']:.2f} and {n['filter_frequency_about_z']:.2f} Hz for "
        "torques about x, y, z; with the numerator c s + k each is the paper's eq. 1. Both models "
        "get the same rotors; gimbals held (docs/theory.md, section 14.9)."
    )


def _filter_caption(n: dict[str, float]) -> str:
    return (
        "Top: bus rate at order 1 of the rotors over rotor speed, root sum of squares over rotors. "
        "Bottom: error of the filters at 6000 rpm, that of the complex amplitudes over their size "
        "(grey: within 10 %; dotted: the paper's satellite; over momentum the middle and 5 % to "
        "95 % of random gimbal angles). **About z the filters are good "
        f"enough**: {100 * n['filters_z_error']:.0f} % off at 6000 rpm, and above 10 % only from "
        f"{n['filters_z_off_from_hz']:.1f} to {n['filters_z_off_to_hz']:.1f} Hz "
        f"({100 * n['filters_z_worst_error']:.0f} %), where the bus's products of inertia bring "
        "in what is wrong about x and y. **About x and y they are good below "
        f"{n['filters_x_off_from_hz']:.1f} Hz only**: {n['filters_x_peak']:.1f} times too much at "
        f"{n['filters_x_peak_hz']:.1f} Hz, as the true modes are not the filters', "
        f"{n['filters_x']:.2f} and {n['filters_y']:.2f} times at 6000 rpm with phases so wrong "
        f"that the error is {100 * n['filters_x_error']:.0f} %. What they miss is that a tilting "
        "platform also pushes sideways, with its height as lever. At no height does that vanish "
        f"({100 * n['filters_height_error_low']:.0f} to "
        f"{100 * n['filters_height_error_high']:.0f} %), nor at other gimbal angles and momenta "
        f"({100 * n['filters_turned_error_low']:.0f} to "
        f"{100 * n['filters_turned_error_high']:.0f} % about x and y, up to "
        f"{100 * n['filters_turned_error_z_high']:.0f} % about z, 5 % to 95 % of {DRAWS} draws "
        "each). They are least wrong, "
        f"{100 * n['filters_centred_error']:.0f} %, with the platform's mass centre "
        f"{-n['filters_centre']:.2f} m below its upper joints, near the hexapod's centre of "
        "stiffness (half the separation below), where nothing couples on a held bus. One filter "
        "of six by six, with the coupling, on the same bolted satellite is "
        f"{100 * n['coupled_x_error']:.0f} % off at 6000 rpm, at most "
        f"{100 * n['coupled_worst_error']:.0f} % at any speed; what is left is that the bus moves, "
        "without the platform's inertia, and the legs' mass (legs of 4 kg: "
        f"{100 * n['filters_leg_mass_error_z']:.0f} % about z). Without the damper in the "
        f"numerator the filters pass {100 * n['springs_x']:.0f} % of what they should about x and "
        f"{100 * n['springs_z']:.0f} % about z at 6000 rpm: never leave it out."
    )
