"""Fit of a measured speed-frequency map (waterfall) of one force or torque of a rotor.

A map is a one-sided power spectral density at each of several constant speeds. It is taken as

    S(Omega, f) = floor(f) + sum over orders h of  A_h(Omega)^2 / 2  *  w(f - h Omega / 2 pi)
    A_h(Omega) = C_h Omega^2 |T_h(Omega)|

with w the shape that the spectrum's window gives to a line (lineshape.py) and T the transmission
of the modes between the rotor and what measures it (modes.py), each

    T = (1 + d) / (1 + d - (w / w0)^2 + split Omega w / w0^2),  d = 2i damping w / w0,  w = h Omega

where ``split`` is 0 for a translation and for rocking plus or minus the rotor's spin over its
transverse inertia, for lines that turn with the rotor or against it (model/disturbance.py).

The floor is the same at every speed, or, where that fits better, noise at the rotor that its modes
let pass. Orders are found one after the other as rays that stand out of floor and leakage along
most of their way. Their lines' powers at each speed follow by summing bins, less the floor and the
other lines; coefficients and modes are fitted to these powers by nonlinear least squares.
"""

from dataclasses import replace

import numpy as np

from quietbus.analysis.signals.waterfall.floor import Floor
from quietbus.analysis.signals.waterfall.lineshape import LineShape, segment_size
from quietbus.analysis.signals.waterfall.measured import FitError, Waterfall
from quietbus.analysis.signals.waterfall.misfit import Explained, explained
from quietbus.analysis.signals.waterfall.modes import LineFit, LinePowers, noise_passed, passed
from quietbus.analysis.signals.waterfall.rays import Ray, Rays
from quietbus.analysis.signals.waterfall.result import (
    ComponentFit,
    Estimate,
    FittedMode,
    FittedOrder,
)
from quietbus.analysis.signals.waterfall.window import SeenWindow, seen_window
from quietbus.plain import RPM

LEAST_SPEEDS = 8
LARGEST_DEVIATION = 0.5  # of a coefficient over itself: beyond it is in doubt
LARGEST_LINE_ERROR = 0.2  # RMS of measured over fitted amplitude, less one
_PATTERN = 3.5  # [deviations] of an unlikely misfit's pattern: it is the model's, not scatter
_LEAST_EXPLAINED = 0.5  # of a map's power: with less nothing is said
_WELL_EXPLAINED = 0.9
_CLEAR = 20.0  # power of a line over the noise in a bin, where the line's error counts
_SEEN = 3.0  # deviations of a line's power from nothing
_LEAST_SEEN = 4  # speeds at which a line is seen so
_MEASURES = 3
_SHOWN = 6  # frequencies in a note


def fit(measured: Waterfall, most: int = 20) -> ComponentFit:
    """Orders, coefficients, modes and broadband floor of a map.

    Args:
        most: number of orders that are looked for.

    Raises:
        FitError: too few speeds, no order stands out, the window is not the lines', or what was
            found does not explain the map.
    """
    n = len(measured.speed)
    if n < LEAST_SPEEDS:
        raise FitError(f"expected at least {LEAST_SPEEDS} speeds, got {n}")
    if not measured.psd.any():
        raise FitError("expected values above zero, got none but zeros")
    window = seen_window(measured)
    shape = LineShape(window.name, segment_size(measured.frequency, measured.sample_rate))
    if measured.noise_bandwidth is not None:
        ratio = measured.noise_bandwidth / shape.noise_bandwidth
        measured = replace(measured, psd=measured.psd * ratio, noise_bandwidth=None)
    rays, floor = _found(measured, shape, window, most)
    powers = _line_powers(rays, floor)
    found = powers.fitted()
    at_rotor = False
    if found.modes and not np.any(floor.bounded):
        through = noise_passed(found.modes, measured.speed, measured.frequency)
        inner = Floor(measured, rays.free, rays.tolerance, through)
        at_rotor = inner.misfit < floor.misfit
        if at_rotor:
            floor = inner
            rays.measure(floor)
            powers = _line_powers(rays, floor)
            found = powers.settled(found)
    return _assembled(measured, window, rays, floor, powers, found, at_rotor)


def _found(
    measured: Waterfall, shape: LineShape, window: SeenWindow, most: int
) -> tuple[Rays, Floor]:
    """All rays that stand out, and the floor beneath them."""
    rays = Rays(measured, shape, window.smear)
    floor = Floor(measured, rays.free)
    if window.order is not None:  # its leakage may cover all else
        rays.add(*rays.placed(window.order, floor))
        floor = _floor_beneath(measured, rays, floor)
    refused: list[float] = []
    while len(rays.orders) < most:
        candidate = rays.next_order(floor, refused)
        if candidate is None:
            break
        order, deviation = rays.placed(candidate, floor)
        if not rays.is_ridge(order, floor):
            refused.append(candidate)
            continue
        rays.add(order, deviation)
        floor = _floor_beneath(measured, rays, floor)
    if not rays.orders:
        raise FitError(
            "no order stands out of the floor along its ray; expected lines at multiples of the "
            "speed, and as speed the rotor's own"
        )
    return rays, floor


def _floor_beneath(measured: Waterfall, rays: Rays, floor: Floor) -> Floor:
    for _ in range(_MEASURES):
        rays.measure(floor)
        floor = Floor(measured, rays.free, rays.tolerance)
    rays.measure(floor)
    return floor


def _line_powers(rays: Rays, floor: Floor) -> LinePowers:
    lines = [ray for ray in rays.lines(floor) if _is_seen(ray)]
    if not lines:
        raise FitError("the rays lie too close to each other for the width of a bin")
    return LinePowers(lines, rays.measured.speed, rays.measured.component == "radial_torque")


def _is_seen(ray: Ray) -> bool:
    spread = ray.variance[:, 0] + ray.variance[:, 1] * np.maximum(ray.power, 0.0)
    return int(np.sum(ray.power > _SEEN * np.sqrt(spread))) >= _LEAST_SEEN


def _assembled(
    measured: Waterfall,
    window: SeenWindow,
    rays: Rays,
    floor: Floor,
    powers: LinePowers,
    found: LineFit,
    at_rotor: bool,
) -> ComponentFit:
    # a misfit that scatters widens deviations; one that follows a pattern makes them worthless
    fits = found.fits or found.pattern < _PATTERN
    kept = [ray.order for ray in powers.rays]
    unmeasured = sorted(order for order in rays.orders if order not in kept)
    leak = np.zeros(measured.psd.shape)
    errors = []
    for k, ray in enumerate(powers.rays):
        through = passed(found.modes, ray.order, measured.speed, found.whirl[k])
        power = 0.5 * (found.coefficients[k] * measured.speed**2 * through) ** 2
        share = rays.shape.line(measured.bins, rays.positions(ray.order), ray.smear)
        leak += power[:, None] * share / measured.bin
        clear = ray.power > _CLEAR * ray.noise
        errors.append(np.sqrt(ray.power[clear] / power[ray.at][clear]) - 1.0)
    orders = tuple(_order(ray, found, k, errors[k], fits) for k, ray in enumerate(powers.rays))
    fitted = floor.under(leak)
    said = explained(
        measured,
        fitted,
        [rays.positions(ray.order) for ray in powers.rays],
        [rays.half(ray.order) for ray in powers.rays],
    )
    if said.total < _LEAST_EXPLAINED:
        raise FitError(
            f"what was found, {_orders_text(orders)}, explains {100.0 * said.total:.2g} % of the "
            f"map's power; expected at least {100.0 * _LEAST_EXPLAINED:g} %, lines at multiples "
            "of the speed over a floor that is the same at every speed"
        )
    return ComponentFit(
        measured,
        window,
        orders,
        _modes(powers, found, fits),
        floor.frequency,
        floor.psd,
        floor.bounded,
        at_rotor,
        None if np.all(floor.bounded) else floor.averages,
        fitted,
        tuple(measured.speed[ray.at] for ray in powers.rays),
        tuple(np.sqrt(2.0 * np.maximum(ray.power, 0.0)) for ray in powers.rays),
        _rms(np.concatenate(errors)) or 0.0,
        found.misfit,
        found.chance,
        said,
        tuple(_notes(measured, window, orders, unmeasured, found, fits, floor, said)),
    )


def _rms(errors: np.ndarray) -> float | None:
    return float(np.sqrt(np.mean(errors**2))) if errors.size else None


def _order(ray: Ray, found: LineFit, k: int, errors: np.ndarray, fits: bool) -> FittedOrder:
    value, relative = float(found.coefficients[k]), float(found.deviations[k])
    error, doubt = _rms(errors), None
    if relative > LARGEST_DEVIATION:
        doubt = f"its deviation is {100.0 * relative:.2g} % of the coefficient"
    elif error is not None and error > LARGEST_LINE_ERROR:
        doubt = f"measured lines stray from the fitted by {100.0 * error:.2g} % (RMS)"
    return FittedOrder(
        Estimate(ray.order, ray.deviation),
        Estimate(value, value * relative if fits else None),
        "backward" if found.modes and found.whirl[k] < 0.0 else "forward",
        error,
        doubt,
    )


def _modes(powers: LinePowers, found: LineFit, fits: bool) -> tuple[FittedMode, ...]:
    modes, at = [], len(powers.rays)
    for mode in found.modes:
        numbers = [mode.w0 / (2.0 * np.pi), mode.damping, mode.split][: 3 if mode.split else 2]
        told = [
            Estimate(value, float(value * found.deviations[at + i]) if fits else None)
            for i, value in enumerate(numbers)
        ]
        modes.append(FittedMode(told[0], told[1], told[2] if mode.split else None))
        at += len(numbers)
    return tuple(sorted(modes, key=lambda mode: mode.frequency.value))


def _notes(
    measured: Waterfall,
    window: SeenWindow,
    orders: tuple[FittedOrder, ...],
    unmeasured: list[float],
    found: LineFit,
    fits: bool,
    floor: Floor,
    said: Explained,
) -> list[str]:
    notes = []
    if window.source == "lines":
        notes.append(f"window: none is declared; lines have the shape of '{window.name}'")
    elif window.source == "assumed":
        notes.append("window: none is declared and no line is strong enough to tell; taken as hann")
    if window.smear > 0.0:
        notes.append(
            f"lines are wider than the window's by a change of speed of {60.0 * window.smear:.2g} "
            "rpm within each row; coefficients are means over it"
        )
    for line in orders:
        if line.doubt is not None:
            notes.append(f"order {line.order.value:.4g} is in doubt: {line.doubt}")
    if not fits:
        notes.append(
            f"the lines do not follow the model: they stray by {found.misfit:.2g} times the "
            "spectra's scatter, neighbouring speeds alike; no deviations are given"
        )
    elif not found.fits:
        notes.append(
            f"the lines scatter {found.misfit:.2g} times as much as their spectra; deviations are "
            "widened by as much"
        )
    for order in unmeasured:
        notes.append(
            f"order {order:.4g} stands out, but alone at too few speeds to be measured; it is "
            "left out"
        )
    if len(floor.fixed):
        shown = ", ".join(f"{f:.4g}" for f in floor.fixed[:_SHOWN])
        more = f" and {len(floor.fixed) - _SHOWN} more" if len(floor.fixed) > _SHOWN else ""
        notes.append(f"lines at every speed the same, no part of the floor: {shown}{more} Hz")
    if np.any(floor.bounded):
        where = floor.frequency[floor.bounded]
        notes.append(
            f"floor: leakage of lines hides it at {np.sum(floor.bounded)} of "
            f"{len(floor.bounded)} frequencies from {where[0]:.3g} to {where[-1]:.3g} Hz; "
            "what is given there is an upper bound"
        )
    poor = said.by_speed < _LEAST_EXPLAINED
    if np.any(poor):
        which = RPM * measured.speed[poor]
        notes.append(
            f"at {np.sum(poor)} speeds, from {which[0]:.4g} to {which[-1]:.4g} rpm, less than "
            f"{100.0 * _LEAST_EXPLAINED:g} % of the power is explained"
        )
    elif said.total < _WELL_EXPLAINED:
        notes.append(f"{100.0 * said.total:.2g} % of the map's power is explained")
    return notes


def _orders_text(orders: tuple[FittedOrder, ...]) -> str:
    return "order " + ", ".join(f"{line.order.value:.4g}" for line in orders)
