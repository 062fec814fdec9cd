"""How well `fit` recovers made waterfalls: the tables of docs/import.md.

    python benchmarks/fit_waterfall.py            # both tables, some minutes
    python benchmarks/fit_waterfall.py recovery   # windows by noise
    python benchmarks/fit_waterfall.py coverage   # what the standard deviations are worth

The maps are made in time, of sines and white noise, and averaged by SciPy's Welch; nothing of the
package's own model enters them.
"""

import argparse
from collections.abc import Sequence

import numpy as np
from scipy.signal import welch

from quietbus.analysis.signals.waterfall import ComponentFit, FitError, Waterfall, fit

RATE, SEGMENT = 1024.0, 1024
WINDOWS = ("hann", "hamming", "blackman", "flattop", "boxcar", "tukey 0.25")
NOISES = (1e-8, 1e-6, 1e-4, 1e-3, 1e-2)  # [N] RMS
LINES = ((1.0, 1e-6), (2.0, 3e-7), (4.42, 1.5e-7))  # order, coefficient [kg m]
MODES = ((110.0, 0.02), (190.0, 0.03))  # [Hz], damping; in series
REALISATIONS = 50


def spectra(
    window: str,
    noise: float,
    modes: Sequence[tuple[float, float]] = (),
    lines: Sequence[tuple[float, float]] = LINES,
    seconds: int = 16,
    change: float = 0.0,
    speeds: Sequence[float] = np.arange(600.0, 3001.0, 100.0),
    seed: int = 1,
    declared: bool = True,
) -> Waterfall:
    """A map of a radial force.

    Args:
        noise: RMS [N].
        change: of speed within a row [rpm], at a constant rate.
        speeds: [rpm].
    """
    rng = np.random.default_rng(seed)
    t = np.arange(int(seconds * RATE)) / RATE
    name, *parameters = window.split()
    given = (name, *map(float, parameters)) if parameters else name
    rows = []
    for rpm in speeds:
        speed = rpm * np.pi / 30
        x = rng.normal(0.0, noise, len(t))
        angle = speed * t + change * np.pi / 30 * (0.5 * t**2 / t[-1] - 0.5 * t)
        for order, coefficient in lines:
            f, through = order * speed / (2 * np.pi), 1.0
            for natural, damping in modes:
                d = 2j * damping * f / natural
                through *= abs((1 + d) / (1 + d - (f / natural) ** 2))
            phase = rng.uniform(0, 2 * np.pi)
            x += coefficient * speed**2 * through * np.cos(order * angle + phase)
        frequency, psd = welch(x, RATE, given, SEGMENT)
        rows.append(psd)
    speed = np.asarray(speeds) * np.pi / 30
    told = window if declared else None
    return Waterfall("radial_force", speed, frequency, np.array(rows), told)


def worst(found: ComponentFit, lines: Sequence[tuple[float, float]]) -> str:
    """Largest error of a coefficient [%], or what else was found."""
    orders = [round(line.order.value, 2) for line in found.orders]
    if orders != [order for order, _ in lines]:
        return f"orders {orders}"
    errors = [
        abs(line.coefficient.value / coefficient - 1)
        for line, (_, coefficient) in zip(found.orders, lines, strict=True)
    ]
    return f"{100 * max(errors):.2g}"


def recovery() -> None:
    """Windows by noise: orders, coefficients, modes."""
    for title, given in (
        ("one line, no mode", {"lines": LINES[:1]}),
        ("three lines, two modes", {"modes": MODES}),
        ("three lines, speed changes by 15 rpm in a row", {"change": 15.0}),
        ("three lines, window not declared", {"declared": False}),
        ("three lines, a single periodogram", {"seconds": 1}),
    ):
        print(f"\n{title}: largest error of a coefficient [%]\n")
        print("| window | " + " | ".join(f"{noise:g} N" for noise in NOISES) + " |")
        print("|---" * (len(NOISES) + 1) + "|")
        for window in WINDOWS:
            cells = []
            for noise in NOISES:
                lines, modes = given.get("lines", LINES), given.get("modes", ())
                try:
                    found = fit(spectra(window, noise, **given))
                except FitError as error:
                    cells.append(f"refused: {error}")
                    continue
                cell = worst(found, lines)
                if len(found.modes) != len(modes):
                    cell += f", {len(found.modes)} modes"
                if found.window.name != window:
                    cell += f" ({found.window.name})"
                cells.append(cell)
            print(f"| {window} | " + " | ".join(cells) + " |", flush=True)


def coverage(realisations: int) -> None:
    """Share of true values within one and two standard deviations."""
    print(f"\n{realisations} realisations: true values within the stated deviations [%]\n")
    print("| modes | noise [N] | within 1 | within 2 | withheld or other modes |")
    print("|---|---|---|---|---|")
    for modes in ((), MODES[:1], MODES):
        for noise in (3e-3, 1e-2):
            away, other = [], 0
            for seed in range(realisations):
                speeds = np.linspace(600, 6000, 46)
                found = fit(spectra("hann", noise, modes, seconds=8, speeds=speeds, seed=seed))
                estimates = [line.coefficient for line in found.orders]
                estimates += [e for mode in found.modes for e in (mode.frequency, mode.damping)]
                true = [coefficient for _, coefficient in LINES]
                true += [value for mode in modes for value in mode]
                if len(estimates) != len(true) or any(e.deviation is None for e in estimates):
                    other += 1
                    continue
                away += [
                    abs(e.value - value) / e.deviation
                    for e, value in zip(estimates, true, strict=True)
                ]
            shares = [100 * np.mean(np.array(away) < limit) for limit in (1, 2)]
            cells = [len(modes), f"{noise:g}", *(f"{share:.0f}" for share in shares), other]
            print("| " + " | ".join(map(str, cells)) + " |", flush=True)


if __name__ == "__main__":
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0])
    parser.add_argument("which", nargs="?", choices=("recovery", "coverage"))
    parser.add_argument("--realisations", type=int, default=REALISATIONS)
    asked = parser.parse_args()
    if asked.which != "coverage":
        recovery()
    if asked.which != "recovery":
        coverage(asked.realisations)
