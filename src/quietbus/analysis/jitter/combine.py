"""Lines of all orders of all rotors as one number: envelope, worst case, root mean square."""

from dataclasses import dataclass, replace

import numpy as np

SAME_FREQUENCY = 1e-9  # relative: lines closer than this are one
RMS_TIME = (
    1.0  # [s] over which a root mean square is meant: lines that beat more slowly are coherent
)


@dataclass(frozen=True)
class Combined:
    """Amplitudes of all orders of all rotors as one number for each output component.

    Without axes of rotors and orders, otherwise as what was combined, in its unit.
    """

    envelope: np.ndarray  # phases as given: what the sum reaches as lines of other frequency beat
    worst_case: np.ndarray  # any phases: the sum of all amplitudes
    rss: np.ndarray  # root of the sum of squares of all amplitudes
    rms: np.ndarray  # root mean square over RMS_TIME about the instant, phases as given

    def with_lines(
        self, amplitude: np.ndarray, frequency: np.ndarray, angle: np.ndarray
    ) -> "Combined":
        """With further lines of changing frequency, incoherent with the others.

        Args:
            amplitude: (..., line, component) complex; the line is Re(amplitude exp(i angle)).
            frequency: (..., line) d(angle)/dt [rad/s], of either sign.
            angle: (..., line) [rad].
        """
        size = np.abs(amplitude)
        turned = _forward(amplitude * np.exp(1j * angle)[..., None], frequency)
        together = _mean_square(np.moveaxis(turned, -2, 0), np.moveaxis(np.abs(frequency), -1, 0))
        return Combined(
            envelope=self.envelope + np.sum(size, axis=-2),
            worst_case=self.worst_case + np.sum(size, axis=-2),
            rss=np.sqrt(self.rss**2 + np.sum(size**2, axis=-2)),
            rms=np.sqrt(self.rms**2 + together),
        )

    def with_noise(self, square: np.ndarray) -> "Combined":
        """With noise of a mean square: it has no amplitude, and adds to the RMS alone."""
        return replace(self, rms=np.sqrt(self.rms**2 + square))


def combine(
    amplitude: np.ndarray,
    frequency: np.ndarray,
    phase: np.ndarray,
    time: np.ndarray | float = 0.0,
) -> Combined:
    """Combine lines.

    Lines of one frequency add with their phases; those of different frequencies beat, so that
    sooner or later their amplitudes add. (Lines at exactly n-fold frequencies keep their phase to
    each other and may never reach the envelope, which then is an upper bound.) For the RMS lines
    count together that RMS_TIME cannot tell apart, as they stand to each other at the instant.

    Args:
        amplitude: (..., cmg, order, component) complex; the line is Re(amplitude exp(i angle)).
        frequency: (cmg, order) d(angle)/dt [rad/s], of either sign; with the leading axes of
            ``amplitude`` where it changes: lines that always agree in it are one line then.
        phase: (cmg, order) angle at t = 0 [rad], or likewise the angle.
        time: (...) of the amplitudes [s], if frequencies stay.
    """
    amplitude, frequency = np.asarray(amplitude), np.asarray(frequency)
    size = np.abs(amplitude)
    turned = _forward(amplitude * np.exp(1j * np.asarray(phase))[..., None], frequency)
    groups = _groups(np.abs(frequency))
    lines = np.stack([turned[..., mask, :].sum(axis=-2) for mask in groups])
    speeds = np.stack([np.abs(frequency)[..., mask][..., 0] for mask in groups])
    now = lines
    if frequency.ndim == 2 and np.any(time):
        now = lines * np.exp(1j * np.multiply.outer(speeds, time))[..., None]
    return Combined(
        envelope=np.sum(np.abs(lines), axis=0),
        worst_case=np.sum(size, axis=(-3, -2)),
        rss=np.sqrt(np.sum(size**2, axis=(-3, -2))),
        rms=np.sqrt(_mean_square(now, speeds)),
    )


def _forward(turned: np.ndarray, frequency: np.ndarray) -> np.ndarray:
    """Phasors (..., component) as of positive frequencies: conjugates of the others."""
    return np.where((frequency < 0.0)[..., None], turned.conj(), turned)


def _mean_square(lines: np.ndarray, frequency: np.ndarray) -> np.ndarray:
    """Mean square (..., component) over RMS_TIME about an instant.

    Two lines have in common the mean of the cosine that they beat with, ``sin x / x`` with x half
    the phase of a beat in that time; those that part by a turn or more count as independent.

    Args:
        lines: (line, ..., component) phasors at the instant.
        frequency: (line,) or (line, ...) [rad/s], positive.
    """
    square = 0.5 * np.sum(np.abs(lines) ** 2, axis=0)
    for k, line in enumerate(lines):
        for other, f in zip(lines[:k], frequency[:k], strict=True):
            x = 0.5 * RMS_TIME * np.abs(frequency[k] - f) / np.pi
            if np.any(x < 1.0):
                common = np.where(x < 1.0, np.sinc(x), 0.0)
                square = square + np.asarray(common)[..., None] * (line * other.conj()).real
    return np.maximum(square, 0.0)


def _groups(frequency: np.ndarray) -> list[np.ndarray]:
    """Masks (cmg, order) of lines of one frequency."""
    if frequency.ndim > 2:
        return _groups_of_changing(frequency)
    ascending = np.unique(frequency)
    new = np.diff(ascending, prepend=-np.inf) > SAME_FREQUENCY * ascending
    new[0] = True
    starts = ascending[new]
    member = np.searchsorted(starts, frequency, side="right") - 1
    return [member == i for i in range(len(starts))]


def _groups_of_changing(frequency: np.ndarray) -> list[np.ndarray]:
    """The same of frequencies (..., cmg, order)."""
    shape = frequency.shape[-2:]
    lines = frequency.reshape(-1, np.prod(shape)).T
    left, masks = set(range(len(lines))), []
    while left:
        first = lines[min(left)]
        apart = SAME_FREQUENCY * np.max(first)
        alike = {i for i in left if np.max(np.abs(lines[i] - first)) <= apart}
        masks.append(np.isin(np.arange(len(lines)), list(alike)).reshape(shape))
        left -= alike
    return masks
