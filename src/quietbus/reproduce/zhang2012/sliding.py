"""The Coriolis term of a leg that slides while it turns, which the paper's eq. 22 leaves out."""

from typing import NamedTuple

import numpy as np
from scipy.interpolate import CubicSpline
from scipy.spatial.transform import Rotation

from quietbus.plots.style import COLOURS, DASHES, draw_line, new_figure, share_legend
from quietbus.reproduce.parts import Findings
from quietbus.reproduce.zhang2012.bench import Bench

STEP = 0.05  # [s] of the central difference that judges both equations


class Sliding(NamedTuple):
    """A leg's upper part that slides along s while the leg turns; bus axes."""

    mass: float  # [kg]
    lever: float  # [m] of its mass centre from the universal joint
    rate: float  # [m/s] dl/dt
    s: np.ndarray  # (3,) unit vector along the leg
    w: np.ndarray  # (3,) [rad/s] of the leg

    def coriolis_moment(self) -> np.ndarray:
        """(3,) [N m] about the universal joint: m r s x (2 dl/dt w x s)."""
        return 2.0 * self.mass * self.lever * self.rate * np.cross(self.s, np.cross(self.w, self.s))

    def printed_moment(self) -> np.ndarray:
        """(3,) [N m] that eq. 22 has for a leg of constant rates: m r x (w x (w x r))."""
        r = self.lever * self.s
        return self.mass * np.cross(r, np.cross(self.w, np.cross(self.w, r)))

    def moment_of_path(self) -> np.ndarray:
        """(3,) [N m] m r x a, the path differentiated twice: by neither equation."""
        turn = Rotation.from_rotvec(STEP * self.w)
        before = turn.inv().apply((self.lever - STEP * self.rate) * self.s)
        after = turn.apply((self.lever + STEP * self.rate) * self.s)
        r = self.lever * self.s
        return self.mass * np.cross(r, (before - 2.0 * r + after) / STEP**2)


def sliding_leg(bench: Bench) -> Findings:
    """The moment that eq. 22 misses, over the slew."""
    satellite, run = bench.study.satellite, bench.flight("zhang2012-slew")["isolated"]
    legs, joints = satellite.hexapods[0].bodies, satellite.hexapods[0].geometry
    time, rates = run["time"].to_numpy(), run["bus_rate"].to_numpy()
    slide = CubicSpline(time, run["leg_stroke"].to_numpy())(time, 1)  # [m/s] (time, leg)
    p_AU_B = np.asarray(satellite.mounts[0].p_BX_B + joints.p_PU_P - joints.p_BA_B)
    length = np.linalg.norm(p_AU_B, axis=1)
    s = p_AU_B / length[:, None]
    mass, distance = (np.asarray(getattr(legs.upper, name)) for name in ("mass", "distance"))
    lever = length - distance
    across = np.linalg.norm(np.cross(rates[:, None], s[None]), axis=2)  # [rad/s] (time, leg)
    moment = 2.0 * mass * lever * np.abs(slide) * across
    when, which = np.unravel_index(np.argmax(moment), moment.shape)
    worst = Sliding(
        float(mass[which]), float(lever[which]), float(slide[when, which]), s[which], rates[when]
    )
    true = worst.moment_of_path()
    wrong = float(np.linalg.norm(worst.printed_moment() - true))
    left = float(np.linalg.norm(worst.printed_moment() + worst.coriolis_moment() - true))
    numbers = {
        "coriolis_moment": float(np.linalg.norm(worst.coriolis_moment())),
        "coriolis_wrong": wrong,
        "coriolis_left": left,
        "coriolis_error_shown": float(wrong > 100.0 * left),
    }
    figure = new_figure(3.4, "What eq. 22 misses in the slew, largest value in each second")
    axes = figure.subplots()
    block = round(1.0 / (time[1] - time[0]))
    seconds = len(time) // block
    most = moment[: seconds * block].reshape(seconds, block, -1).max(axis=1)
    for i in range(moment.shape[1]):
        look = {"color": COLOURS[i], "linestyle": DASHES[i % 4], "label": f"leg {i}"}
        draw_line(axes, np.arange(seconds) + 0.5, np.maximum(most[:, i], 1e-16), **look)
    axes.set(xlabel="time [s]", ylabel="moment [N m]", yscale="log")
    share_legend(figure, axes)
    text = (
        "Eq. 20 gives the sliding upper part its Coriolis acceleration 2 dl/dt (ω x s), but the "
        "moment equation of the leg, eq. 22, has no moment for it. The upper part's path in the "
        "slew, differentiated twice by differences, needs it: with the term the moment is "
        f"{left:.0e} N m off, without it {wrong:.1e} N m."
    )
    caption = (
        f"Up to {numbers['coriolis_moment']:.1e} N m about a leg's universal joint. It is small "
        "because legs slide slowly and satellites turn slowly; it grows with both, and with the "
        "upper part's mass."
    )
    return Findings(figure, caption, numbers, text)
