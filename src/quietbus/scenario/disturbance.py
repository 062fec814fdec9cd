"""Measured disturbances of rotors and of gimbal motors: orders, resonances, spectra, ripple."""

from __future__ import annotations

from pathlib import Path
from typing import Annotated, Any, Literal, Self

import numpy as np
from pydantic import BeforeValidator, Discriminator, Tag, ValidationInfo, model_validator

from quietbus.scenario.base import (
    Count,
    Frequency,
    Part,
    PositiveAngularVelocity,
    PositiveNumber,
    Series,
    Text,
    listing,
)
from quietbus.scenario.errors import Findings, ScenarioError
from quietbus.scenario.files import TABLE_FOLDERS, within
from quietbus.scenario.limits import MOST_HARMONICS, MOST_LINES_A_TURN
from quietbus.scenario.units import Quantity, expected
from quietbus.scenario.wheel_files import read_wheel_table

# channels of the model: a component that turns has one forward and one backward
CHANNELS_OF = {
    "radial_force": (0, 1),
    "axial_force": (2,),
    "radial_torque": (3, 4),
    "axial_torque": (5,),
}
CHANNEL_COUNT = 6
COMPONENTS = tuple(CHANNELS_OF)

ForceCoefficient = Annotated[
    float, Quantity("a force coefficient, force over speed squared,", "kg*m", least=0.0)
]
TorqueCoefficient = Annotated[
    float, Quantity("a torque coefficient, torque over speed squared,", "kg*m^2", least=0.0)
]
# per Hz, never per rad/s: radians are not ignored here
ForceDensity = Annotated[
    float, Quantity("a one-sided force spectrum", "N^2/Hz", least=0.0, exact=True)
]
TorqueDensity = Annotated[
    float, Quantity("a one-sided torque spectrum", "N^2*m^2/Hz", least=0.0, exact=True)
]
RippleTorque = Annotated[float, Quantity("a torque", "N*m", least=0.0)]


def _seed(value: Any) -> int:
    if isinstance(value, bool) or not isinstance(value, int) or not 0 <= value < 2**63:
        raise expected("a whole number from 0 to 2^63 - 1", value)
    return value


def _phase_form(value: Any) -> str:
    if isinstance(value, dict | Part):
        return "<each>"
    return "<random>" if value == "random" else "<angle>"


PhaseAngle = Annotated[float, Quantity("random, or an angle", "rad")]
Phase = Annotated[
    Annotated[PhaseAngle, Tag("<angle>")] | Annotated[Literal["random"], Tag("<random>")],
    Discriminator(_phase_form),
]


class Phases(Part):
    """A phase for each component."""

    radial_force: Phase = "random"
    axial_force: Phase = "random"
    radial_torque: Phase = "random"
    axial_torque: Phase = "random"


class Order(Part):
    """One line of a harmonic table: amplitudes are coefficients times rotor speed squared."""

    order: PositiveNumber  # multiple of rotor speed
    radial_force: ForceCoefficient = 0.0  # turns across the spin axis
    axial_force: ForceCoefficient = 0.0  # along the spin axis
    radial_torque: TorqueCoefficient = 0.0
    axial_torque: TorqueCoefficient = 0.0
    whirl: Literal["forward", "backward"] = "forward"  # sense in which the radial ones turn
    phase: Annotated[
        Annotated[PhaseAngle, Tag("<angle>")]
        | Annotated[Literal["random"], Tag("<random>")]
        | Annotated[Phases, Tag("<each>")],
        Discriminator(_phase_form),
    ] = "random"

    @property
    def acts(self) -> bool:
        """Whether any coefficient is not zero."""
        return any(getattr(self, component) > 0.0 for component in COMPONENTS)

    def channel_of(self, component: str) -> int:
        """Channel of one of ``COMPONENTS``, by the sense in which it turns."""
        channels = CHANNELS_OF[component]
        return channels[0] if self.whirl == "forward" else channels[-1]

    def phase_of(self, component: str) -> float | Literal["random"]:
        """Phase [rad] of one of ``COMPONENTS``, against order times rotor angle."""
        if isinstance(self.phase, Phases):
            phase: float | Literal["random"] = getattr(self.phase, component)
            return phase
        return self.phase


class Resonance(Part):
    """A mode of the rotor on its bearings, the gimbal held."""

    frequency: Frequency
    damping: PositiveNumber  # over critical damping


class Resonances(Part):
    """Modes of the rotor on its bearings; a missing one is stiff."""

    radial: Resonance | None = None  # translation across the spin axis
    axial: Resonance | None = None  # translation along the spin axis
    rocking: Resonance | None = None  # tilt of the spin axis; frequency at standstill


class _Spectrum(Part):
    """A one-sided power spectral density over frequency; nothing outside the table."""

    frequency: Series[Frequency]
    psd: Any
    interpolation: Literal["log", "linear"] = "log"  # log: straight on double-logarithmic paper
    sample_rate: Frequency | None = None  # of the measurement: frequencies end at its half

    @model_validator(mode="after")
    def _check(self) -> Self:
        findings = Findings()
        if len(self.psd) != len(self.frequency):
            findings.add(
                "psd",
                f"expected {len(self.frequency)} numbers, one for each frequency, "
                f"got {len(self.psd)}",
            )
        if len(self.frequency) < 2:
            findings.add("frequency", "expected at least two frequencies, a band, got one")
        for i in range(1, len(self.frequency)):
            if self.frequency[i] <= self.frequency[i - 1]:
                findings.add(
                    ("frequency", i),
                    f"expected a frequency above {self.frequency[i - 1]:g} Hz, the one before, "
                    f"got {self.frequency[i]:g}",
                )
        if self.sample_rate is not None:
            for i, frequency in enumerate(self.frequency):
                if frequency > 0.5 * self.sample_rate:
                    findings.add(
                        ("frequency", i),
                        f"expected at most {0.5 * self.sample_rate:g} Hz, the Nyquist frequency "
                        f"of the table's sample_rate, got {frequency:g}",
                    )
        if self.interpolation == "log":
            for i, value in enumerate(self.psd):
                if value <= 0.0:
                    findings.add(
                        ("psd", i),
                        f"expected a number above 0 for interpolation log, got {value:g}; "
                        "interpolation linear takes zeros",
                    )
        findings.raise_any()
        return self


class ForceSpectrum(_Spectrum):
    """Force along each axis it acts on."""

    psd: Series[ForceDensity]


class TorqueSpectrum(_Spectrum):
    """Torque about each axis it acts on."""

    psd: Series[TorqueDensity]


class Broadband(Part):
    """Noise of the rotor's bearings; a radial one acts along both axes across the spin axis."""

    radial_force: ForceSpectrum | None = None
    axial_force: ForceSpectrum | None = None
    radial_torque: TorqueSpectrum | None = None
    axial_torque: TorqueSpectrum | None = None

    def given(self) -> dict[str, ForceSpectrum | TorqueSpectrum]:
        """The spectra that there are, by component."""
        spectra = {name: getattr(self, name) for name in COMPONENTS}
        return {name: spectrum for name, spectrum in spectra.items() if spectrum is not None}


class Disturbance(Part):
    """What a rotor does to its gimbal beyond the imbalance of a rigid body."""

    table: Text | None = None  # file with the orders, read when the scenario is
    orders: Annotated[tuple[Order, ...], listing(None, "orders")] | None = None
    resonances: Resonances = Resonances()
    broadband: Broadband = Broadband()
    seed: Annotated[int, BeforeValidator(_seed)] = 0  # of random phases and of the noise

    def phases(self, unit: int) -> tuple[dict[str, float], ...]:
        """Phase of each component of each line [rad], drawn where it is random.

        Args:
            unit: number of the rotor in the satellite; rotors of one seed differ by it.
        """
        lines = self.orders or ()
        # drawn for all, whether random or not, so that a phase given changes no other
        generator = np.random.default_rng([self.seed, unit])
        drawn = generator.uniform(-np.pi, np.pi, (len(lines), CHANNEL_COUNT))
        found = []
        for line, own in zip(lines, drawn, strict=True):
            given = {name: line.phase_of(name) for name in COMPONENTS}
            found.append(
                {
                    name: float(own[line.channel_of(name)]) if phase == "random" else phase
                    for name, phase in given.items()
                }
            )
        return tuple(found)

    @model_validator(mode="before")
    @classmethod
    def _read_table(cls, data: Any, info: ValidationInfo) -> Any:
        """Put the orders and resonances of the file, or of several, in the place of the name.

        A relative path starts at the folder of the scenario's file. A scenario may come from
        anyone, so it may name files there only, unless the user allows other folders.
        """
        if not isinstance(data, dict) or data.get("table") is None:
            return data
        findings = Findings()
        given = data["table"]
        names = given if isinstance(given, list) else [given]
        if not names or not all(isinstance(name, str) and name for name in names):
            what = "the name of a file, or a list of names"
            findings.add("table", expected(what, given).message())
            findings.raise_any()
        if data.get("orders") is not None:
            findings.add("table", "expected either table or orders, got both")
        findings.raise_any()
        home = (info.context or {}).get("folder")  # None: data of a program, which may name any
        folder = Path(home or ".")
        for name in names:
            if home is not None and not within(folder / name, folder):
                what = f"a file in the scenario's folder or in those that {TABLE_FOLDERS} names"
                findings.add("table", expected(what, name).message())
        findings.raise_any()
        try:
            table = read_wheel_table([folder / name for name in names])
        except ScenarioError as error:
            for problem in error.problems:
                findings.add("table", f"{error.source}: {problem}")
            findings.raise_any()
            raise
        for lost in table.lost:
            findings.add("table", f"{table.source}: cannot be taken over: {lost}")
        findings.raise_any()
        return table.to_dict() | {key: value for key, value in data.items() if key != "table"}

    @model_validator(mode="after")
    def _check(self) -> Self:
        findings = Findings()
        orders = self.orders or ()
        for i in range(1, len(orders)):
            before, this = ((o.order, o.whirl == "backward") for o in orders[i - 1 : i + 1])
            if this <= before:
                findings.add(
                    ("orders", i, "order"),
                    f"expected an order above {before[0]:g}, the one before, got {this[0]:g}",
                )
        if not orders and not self.broadband.given() and self.resonances != Resonances():
            findings.add(
                "resonances",
                "expected orders or broadband beside them: resonances amplify these alone, "
                "not the imbalance of the rigid rotor",
            )
        findings.raise_any()
        return self


MOTOR_PHASES = 3  # of the streams of random numbers of a unit


class Ripple(Part):
    """Torque of a gimbal motor that repeats over a turn of the gimbal."""

    per_turn: Annotated[int, Count(MOST_LINES_A_TURN)]
    torque: RippleTorque  # amplitude
    phase: Phase = "random"  # against per_turn times gimbal angle


class Stepping(Part):
    """A motor that turns the gimbal in steps, which the gimbal follows as an oscillator."""

    steps_per_turn: Annotated[int, Count(MOST_LINES_A_TURN)]  # of the gimbal, gear included
    frequency: Frequency  # of the oscillation about a step
    damping: PositiveNumber  # over critical damping
    harmonics: Annotated[int, Count(MOST_HARMONICS)] = 5  # of the stepping frequency, taken along
    phase: Phase = "random"  # of the steps against steps_per_turn times gimbal angle


class GimbalMotor(Part):
    """What the gimbal motors do beyond following their command."""

    ripple: Annotated[tuple[Ripple, ...], listing(None, "ripples")] | None = None
    stepping: Stepping | None = None
    # [rad/s] ripple slower than this is held by the motor; None: a tenth of the servo's bandwidth
    holding_bandwidth: PositiveAngularVelocity | None = None

    def phases(self, seed: int, unit: int) -> tuple[tuple[float, ...], float]:
        """Phases of ripple and of steps [rad] of one unit's motor, drawn where they are random.

        Args:
            seed, unit: of the rotor on this gimbal, and its number in the satellite.
        """
        given: list[float | Literal["random"]] = [line.phase for line in self.ripple or ()]
        given.append(self.stepping.phase if self.stepping else 0.0)
        generator = np.random.default_rng([seed, unit, MOTOR_PHASES])
        drawn = zip(given, generator.uniform(-np.pi, np.pi, len(given)).tolist(), strict=True)
        *ripple, steps = (own if said == "random" else said for said, own in drawn)
        return tuple(ripple), steps

    @property
    def lines(self) -> tuple[int, ...]:
        """Multiples of the gimbal angle: those of ripple, then those of steps."""
        steps = self.stepping
        harmonics = range(1, steps.harmonics + 1) if steps else ()
        return (
            *(ripple.per_turn for ripple in self.ripple or ()),
            *(k * steps.steps_per_turn for k in harmonics if steps),
        )

    @model_validator(mode="after")
    def _check(self) -> Self:
        findings = Findings()
        if self.ripple is None and self.stepping is None:
            findings.add((), "expected ripple, stepping or both, got neither")
        findings.raise_any()
        return self
