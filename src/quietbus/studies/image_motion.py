"""Image motion of a line of sight, from a run: slow motion, harmonic ones with lines and noise."""

import numpy as np
import xarray as xr
from scipy.spatial.transform import Rotation

from quietbus.analysis.pointing.motion import ImageMotion, Lines, SampledSignal
from quietbus.analysis.pointing.noise import Noise
from quietbus.model.body import body_quantities
from quietbus.results import AXES, method_of, scenario_of
from quietbus.scenario import Scenario

RIPPLE = (
    "the lines that cluster.gimbal_motor makes have the frequency of the gimbals' rates, which "
    "changes: a harmonic run cannot judge them. Use method 'direct', or take gimbal_motor out to "
    "judge the rest"
)
STEADY = 0.02  # relative change of a rotor's speed that counts as none


def image_motion(
    run: xr.Dataset, name: str, stretch: tuple[float, float] | None = None
) -> ImageMotion:
    """Image motion of a line of sight of the run's scenario [rad].

    The signal is the error against the commanded attitude, the whole of it of a direct run and its
    slow part of a harmonic one, whose lines and noise come beside it.

    Args:
        stretch: [s] over which rotors' speeds have to be steady; the whole run by default.

    Raises:
        ValueError: the scenario has no such line of sight, or the run has ripple of gimbal motors
            or rotors whose speed changes: lines of changing frequency.
    """
    scenario = scenario_of(run)
    if name not in scenario.lines_of_sight:
        known = ", ".join(scenario.lines_of_sight) or "none"
        raise ValueError(f"line of sight: expected one of {known}; got {name!r}")
    line, on = scenario.sight(name), scenario.seen_from(name)
    time = run["time"].to_numpy()
    signal = SampledSignal(time, body_errors(run, scenario, on) @ (line.image() @ line.matrix()).T)
    if not method_of(run).jitter_apart:
        return ImageMotion(signal)
    amplitude, shift = (
        run[f"line_of_sight_jitter_{part}"]
        .sel(line=name)
        .transpose("time", "cmg", "order", "axis")
        .to_numpy()
        for part in ("amplitude", "phase")
    )
    image = (amplitude * np.exp(1j * shift)) @ line.image().T
    orders = run["order"].to_numpy()
    if np.any(run.get("line_of_sight_ripple_amplitude", 0.0)):
        raise ValueError(RIPPLE)
    speed, phase = rotors_of(run, stretch)
    lines = Lines(
        amplitude=image.reshape(len(time), -1, image.shape[-1]),
        frequency=np.outer(speed, orders).ravel(),
        phase=np.outer(phase, orders).ravel(),
        rotor=np.repeat(np.arange(len(speed)), len(orders)),
        order=np.tile(orders, len(speed)),
    )
    return ImageMotion(signal, lines, _noise(run, name, line.image()))


def rotors_of(
    run: xr.Dataset, stretch: tuple[float, float] | None
) -> tuple[np.ndarray, np.ndarray]:
    """Speeds [rad/s] of the rotors and their angles at t = 0 [rad], as of steady ones.

    Raises:
        ValueError: a speed that changes within the stretch.
    """
    time = run["time"].to_numpy()
    start, end = stretch or (time[0], time[-1])
    here = (time >= start - 1e-9) & (time <= end + 1e-9)
    speeds, angles = (run[f"rotor_{part}"].to_numpy()[here] for part in ("speed", "angle"))
    change = float(np.max(np.ptp(speeds, axis=0)) / max(np.max(np.abs(speeds)), 1e-300))
    if change > STEADY:
        raise ValueError(
            f"the rotors' speeds change by up to {100 * change:.3g} % from {start:g} s to {end:g} "
            f"s, and the frequencies of their lines with them: a harmonic run judges stretches in "
            f"which they change by {100 * STEADY:g} % at most. Use method 'direct', or another "
            "stretch (start, end)"
        )
    speed = speeds.mean(axis=0)
    return speed, np.mean(angles - np.outer(time[here], speed), axis=0)


def _noise(run: xr.Dataset, name: str, image: np.ndarray) -> Noise | None:
    """Of a line of sight's image, by rotor; None where no rotor has a broadband disturbance."""
    if "line_of_sight_psd" not in run:
        return None
    psd, cross = (
        run[f"line_of_sight_{kind}"]
        .sel(line=name)
        .transpose("look", "frequency", "cmg", ...)
        .to_numpy()
        for kind in ("psd", "cospectrum")
    )
    density = psd[..., None] * np.eye(3)
    for k, pair in enumerate(run["pair"].to_numpy()):
        a, b = (AXES.index(axis) for axis in pair)
        density[..., a, b] = density[..., b, a] = cross[..., k]
    density = np.einsum("ia,lfjab,kb->lfjik", image, density, image)
    names = tuple(f"rotor {j}, broadband" for j in run["cmg"].to_numpy())
    return Noise(run["look"].to_numpy(), run["frequency"].to_numpy(), density, names)


def body_errors(run: xr.Dataset, scenario: Scenario, on: str = "bus") -> np.ndarray:
    """(n, 12) motions in the order of a sensitivity's columns, along bus axes.

    Args:
        on: the body that a line of sight is on.
    """
    turn, shift = run["attitude_error"].to_numpy(), _of(run, "bus", "position")
    bus = Rotation.from_quat(_of(run, "bus", "attitude"), scalar_first=True)
    shift = bus.inv().apply(shift)

    def from_place(body: str) -> tuple[np.ndarray, np.ndarray]:
        """Turn and displacement of a body from its place in the bus."""
        if body == "bus":
            return 0.0 * turn, 0.0 * turn
        place, nominal = scenario.place(body)
        own = Rotation.from_quat(_of(run, body, "attitude"), scalar_first=True)
        p = bus.inv().apply(_of(run, body, "position") - _of(run, "bus", "position"))
        return (bus.inv() * own * nominal.inv()).as_rotvec(), p - place

    here, there = from_place(on), from_place(scenario.seen_with(on))
    place, other = scenario.place(on)[0], scenario.place(scenario.seen_with(on))[0]
    whole = turn + here[0]
    # of the other body from its place in this one: what this one's turn takes it along comes off
    moved = there[1] - here[1] - np.cross(here[0], other - place)
    moved_along = shift + np.cross(turn, place) * (on != "bus") + here[1]
    return np.hstack([whole, moved_along, there[0] - here[0], moved])


def _of(run: xr.Dataset, body: str, kind: str) -> np.ndarray:
    """A quantity of a body, by its name in the run."""
    return run[body_quantities(body)[kind].name].to_numpy()
