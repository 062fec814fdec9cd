"""Attitude loops: the paper's, and stand-ins."""

import control
import numpy as np

from quietbus.analysis.control.loop import Loop, attitude_loop
from quietbus.analysis.control.pid import PID
from quietbus.analysis.control.symbolic import SymbolicChannel

INERTIA = 1100.0
PRINTED = SymbolicChannel((1.0, 0.036), (70.3, 3.69, 0.036))
CHANNEL = PRINTED.coefficients(20e3, 500.0)
PAPER_PID = PID.from_gain_and_zeros(2500.0, (0.079, 5e-4))
RIGID = ((1.0,), (1.0,))


def paper_loop(channel=CHANNEL, pid=PAPER_PID, **options):
    return attitude_loop(*channel, INERTIA, pid, **options)


def paper_control(pid=PAPER_PID):
    """The same loop put together by python-control."""
    s = control.tf("s")
    return (pid.kp + pid.ki / s + pid.kd * s) * control.tf(*CHANNEL) / (INERTIA * s**2)


def unstable_at(loop, gain):
    return int(np.sum(loop.closed_loop_poles(gain).real > 0))


def with_pade(loop, order=9):
    """A rational stand-in for a loop with a delay."""
    top, bottom = control.pade(loop.delay, order)
    return Loop(
        tuple(np.polymul(loop.numerator, top)),
        tuple(np.polymul(loop.denominator, bottom)),
        gain=loop.gain,
    )
