"""Y. Zhang and S. Xu (2012): what the paper claims, how we get it, what differs.

J. Aerospace Engineering 25(4), 641-652. The published numbers are in ``claims.py``; the other
modules make the figures, and our values with them.
"""

from quietbus.reproduce.parts import Paper, Part
from quietbus.reproduce.zhang2012 import (
    control,
    engine,
    filters,
    flights,
    missing,
    per_cmg,
    sensitivity,
    sliding,
)
from quietbus.reproduce.zhang2012.bench import Bench
from quietbus.reproduce.zhang2012.claims import CLAIMS

ENGINE = {"mujoco": "validate"}  # the library, and the extra that it comes with

PAPER = Paper(
    name="zhang2012",
    reference=(
        "Y. Zhang, S. Xu, Vibration Isolation Platform for Control Moment Gyroscopes on "
        "Satellites, Journal of Aerospace Engineering 25(4), 2012, 641-652"
    ),
    claims=CLAIMS,
    bench=Bench,
    chapters={
        "The paper's figures": (
            Part("figure-01b", "Figure 1b: frequency response of one strut", control.single_strut),
            Part("figure-04", "Figure 4: model validation", engine.validation, ENGINE),
            Part("figure-06", "Figure 6: root locus about x", control.locus),
            Part("figure-07", "Figure 7: Bode plot about x", control.bode),
            Part("figure-08", "Figure 8: Nyquist plot about x", control.nyquist),
            Part("figure-09", "Figure 9a, b: stabilisation", flights.stabilisation),
            Part("figure-10", "Figure 10: attitude in the slew", flights.slew_angles),
            Part("figure-11", "Figure 11a, b: rates in the slew", flights.slew_rates),
            Part("figure-12", "Figure 12: gimbal angles in the slew", flights.slew_gimbals),
            Part("sensitivity", "What the missing parameters could be", sensitivity.sensitivity),
        ),
        "What the paper misses": (
            Part("universal-joint", "A universal joint on a turning base", missing.universal_joint),
            Part("sliding", "A leg that slides while it turns", sliding.sliding_leg),
            Part("margins", "Margins fall as the platform rises", missing.margins_by_height),
            Part("corner", "A corner frequency that is a peak", missing.corner),
            Part("neglected", "Fixed base, light legs, still rotors", missing.neglected),
        ),
        "What else could stand between CMGs and bus": (
            Part("filters", "Six low-pass filters for the isolator", filters.filters),
            Part("per-cmg", "One isolator per CMG", per_cmg.per_cmg),
        ),
    },
)
