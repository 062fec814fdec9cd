"""A channel with stiffness and damping as symbols, normalised as in the paper."""

from __future__ import annotations

import math
from dataclasses import dataclass

import numpy as np

from quietbus.analysis.control.rational import Coefficients


@dataclass(frozen=True)
class SymbolicChannel:
    """A channel as a function of s, k and c, for legs that share one c/k.

    With u = c s + k and n the number of coordinates that take part,

        G = sum_m N_m s^(2m) u^(n-m) / sum_m D_m s^(2m) u^(n-m),

    normalised so that N's leading coefficient is 1: the paper divides by d' m. k and c are the
    legs' mean stiffness and damping.
    """

    numerator: Coefficients  # N_m [-], descending in s^2/u
    denominator: Coefficients  # D_m [-], [kg], ... descending in s^2/u

    def coefficients(self, stiffness: float, damping: float) -> tuple[Coefficients, Coefficients]:
        """Numerator and denominator in descending powers of s for numbers k and c."""
        order = len(self.denominator) - 1
        u = np.trim_zeros(np.array([damping, stiffness], float), "f")
        powers = [np.ones(1)]
        for _ in range(order):
            powers.append(np.convolve(powers[-1], u))

        def expand(terms: Coefficients) -> Coefficients:
            total = np.zeros(2 * order + 1)
            for m, value in enumerate(reversed(terms)):
                term = powers[order - m]  # times s^(2m): sits above 2m trailing zeros
                end = total.size - 2 * m
                total[end - term.size : end] += value * term
            return tuple(np.trim_zeros(total, "f").tolist())

        return expand(self.numerator), expand(self.denominator)

    def terms(self, which: str) -> dict[tuple[int, int, int], float]:
        """Coefficient of each s^i c^j k^l, keyed (i, j, l), of "numerator" or "denominator"."""
        order = len(self.denominator) - 1
        result: dict[tuple[int, int, int], float] = {}
        for m, value in enumerate(reversed(getattr(self, which))):
            for j in range(order - m + 1):
                if value:
                    key = (2 * m + j, j, order - m - j)
                    result[key] = value * math.comb(order - m, j)
        return dict(sorted(result.items(), reverse=True))

    def __str__(self) -> str:
        return f"({self._text('numerator')}) / ({self._text('denominator')})"

    def _text(self, which: str) -> str:
        factors = []
        for (i, j, l), value in self.terms(which).items():
            symbols = [
                name if power == 1 else f"{name}^{power}"
                for name, power in (("k", l), ("c", j), ("s", i))
                if power
            ]
            number = f"{value:.4g}"
            factors.append(" ".join(symbols if number == "1" and symbols else [number, *symbols]))
        return " + ".join(factors).replace("+ -", "- ")
