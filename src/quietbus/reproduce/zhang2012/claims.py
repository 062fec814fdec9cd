"""The published numbers of Zhang and Xu (2012), each with its place; ours come from the parts."""

from quietbus.reproduce.claims import Claim

_GEOMETRY = (
    "the paper's coefficient is ours divided by d' m = 0.125 x 82.8 kg, derived from the cubic "
    "hexapod of eq. 31; what is left is in the paper's last digit"
)
_ASSUMED = (
    "it depends on rotor speed, momentum, imbalance split, phases and platform offset, which the "
    "paper does not state"
)


def _tf(name: str, what: str, printed: str) -> Claim:
    return Claim(name, "eq. 31-32", f"coefficient of {what}", printed, "", _GEOMETRY)


CLAIMS = (
    Claim(
        "crossing",
        "section 2, fig. 1b",
        "frequency ratio above which a strut isolates",
        "√2",
        "",
        "found as the root of eq. 2 = 1; the three dampings agree to {crossing_spread:.0e}",
        number=2.0**0.5,
    ),
    Claim(
        "static_imbalance",
        "section 2",
        "static imbalance of a rotor, printed in g/cm²",
        "1.36",
        "g cm",
        "g/cm² is refused as a mass times a length; g cm is meant, {imbalance_force:.2g} N at the "
        "assumed speed",
        error="static_unit_refused",
    ),
    Claim(
        "dynamic_imbalance",
        "section 2",
        "dynamic imbalance of a rotor, printed in g/cm²",
        "17",
        "g cm²",
        "g/cm² is refused as a product of inertia; g cm² is meant, {imbalance_torque:.2g} N m at "
        "the assumed speed",
        error="dynamic_unit_refused",
    ),
    Claim(
        "joint_violation_paper",
        "eq. 12",
        "turn of a leg about h relative to its base, which the joint does not allow",
        "0",
        "rad/s",
        "eq. 12 leaves out the base's rate: in the slew its legs turn in a joint that cannot, ours "
        "by {joint_violation:.0e} rad/s",
        rounding=1e-9,
        error="joint_error_shown",
    ),
    Claim(
        "validation_difference",
        "fig. 4",
        "difference of the two programs' curves, over the largest motion",
        "0",
        "",
        "'the same' in the paper means to a line's width, 0.5 %; MuJoCo stands in for ADAMS",
        rounding=5e-3,
    ),
    Claim(
        "platform_mass",
        "section 5",
        "mass of the upper platform with its CMGs",
        "82.8",
        "kg",
        "sum over plate, gimbal bodies and rotors",
    ),
    *(
        Claim(
            f"platform_inertia_{axis}",
            "section 5",
            f"inertia of the same about {axis}",
            printed,
            "kg m²",
            "summed over all bodies about the common mass centre; the bare plate's share is "
            "assumed so that it comes out",
        )
        for axis, printed in (("x", "8.8"), ("y", "8.8"), ("z", "15"))
    ),
    _tf("tf_s4", "s⁴", "70.3"),
    _tf("tf_cs3", "c s³", "3.69"),
    _tf("tf_ks2", "k s²", "3.69"),
    _tf("tf_c2s2", "c² s² in the denominator", "0.036"),
    _tf("tf_kcs", "k c s in the denominator", "0.072"),
    _tf("tf_k2", "k² in the denominator", "0.036"),
    _tf("tf_numerator_c2s2", "c² s² in the numerator", "0.036"),
    _tf("tf_numerator_kcs", "k c s in the numerator", "0.072"),
    _tf("tf_numerator_k2", "k² in the numerator", "0.036"),
    Claim("tf_z_s2", "eq. 33", "coefficient of s²", "20", "kg", "I_z over K_z/k = 0.75, exactly"),
    Claim(
        "channel_zeros",
        "section 5, fig. 6",
        "zeros that the platform brings into the loop",
        "3",
        "",
        "degree of the numerator of the channel about x",
    ),
    Claim(
        "channel_poles",
        "section 5, fig. 6",
        "poles that the platform brings into the loop",
        "4",
        "",
        "degree of the denominator of the channel about x",
    ),
    *(
        Claim(
            name,
            "section 6",
            f"controller's {name[0].upper()}{name[1]}",
            printed,
            unit,
            "K (s + t_p)(s + t_q)/s multiplied out with K = 2500, t_p = 0.079, t_q = 5e-4; the "
            "paper uses the rounded ones, and so do we",
        )
        for name, printed, unit in (
            ("kp", "200", "N m/rad"),
            ("ki", "0.1", "N m/(rad s)"),
            ("kd", "2500", "N m s/rad"),
        )
    ),
    Claim(
        "gain_low",
        "eq. 37",
        "least stable K about x",
        "0.5",
        "N m s/rad",
        "with the derived channel; with the printed coefficients {printed_gain_low:.3f}",
    ),
    Claim(
        "gain_high",
        "eq. 37",
        "largest stable K about x",
        "9130",
        "N m s/rad",
        "with the derived channel; with the printed coefficients {printed_gain_high:.0f}: the "
        "paper's was read off a diagram",
    ),
    Claim(
        "gain_margin",
        "fig. 7",
        "gain margin about x",
        "11.2",
        "dB",
        "at {gain_margin_frequency:.2f} Hz; the loop is conditionally stable, the gain may also "
        "change by {gain_reduction_margin:.1f} dB at the least",
    ),
    Claim("phase_margin", "fig. 7", "phase margin about x", "88", "°", "at the one crossover"),
    Claim(
        "bandwidth",
        "section 5",
        "bandwidth of the attitude control",
        "0.37",
        "Hz",
        "it is the 0 dB crossover of the open loop",
    ),
    *(
        Claim(
            f"nyquist_{name}",
            "fig. 8",
            what,
            printed,
            "",
            "counted over positive frequencies, arcs around poles at zero included; checked by "
            "the closed loop's roots",
        )
        for name, what, printed in (
            ("N1", "positive crossings N1", "1"),
            ("N2", "negative crossings N2", "1"),
            ("N", "turns N = N1 - N2", "0"),
            ("P", "open-loop poles in the right half-plane P", "0"),
            ("Z", "closed-loop poles in the right half-plane Z = P - 2 N", "0"),
        )
    ),
    *(
        Claim(
            f"corner_{axis}",
            "section 5",
            f"corner frequency about {axis}",
            "2.46",
            "Hz",
            f"it is the peak of the channel's gain ({{corner_{axis}_gain:.2f}}), not a natural "
            f"frequency ({{corner_{axis}_undamped:.2f}} Hz undamped); with the printed "
            "coefficients {printed_corner:.3f} Hz",
        )
        for axis in ("x", "y")
    ),
    Claim(
        "corner_z",
        "section 5",
        "corner frequency about z",
        "4.58",
        "Hz",
        "by the rule of x and y it is {corner_z:.3f}; neither damped {corner_z_damped:.3f} nor "
        "undamped {corner_z_undamped:.3f} Hz is the paper's either",
    ),
    Claim(
        "decade",
        "section 5",
        "corner frequency over bandwidth, 'about one decade'",
        "10",
        "",
        "the paper's own 2.46 Hz and 0.37 Hz are not a decade apart",
        assumed=True,
    ),
    Claim(
        "residual_rigid",
        "fig. 9a",
        "residual rate without the platform, stabilisation",
        "3.4e-4",
        "°/s",
        _ASSUMED + "; worst axis",
        assumed=True,
    ),
    Claim(
        "residual_isolated",
        "fig. 9b",
        "residual rate with the platform, stabilisation",
        "1.1e-5",
        "°/s",
        _ASSUMED + "; worst axis",
        assumed=True,
    ),
    Claim(
        "ratio",
        "section 6",
        "rate with over without the platform, stabilisation",
        "3",
        "%",
        _ASSUMED + "; by axis {ratio_x:.2g}, {ratio_y:.2g}, {ratio_z:.2g} %, and see the "
        "sensitivity picture",
        assumed=True,
    ),
    Claim(
        "printed_ratio",
        "section 6",
        "the same from the paper's own 1.1e-5 and 3.4e-4",
        "3",
        "%",
        "arithmetic of the paper's numbers",
    ),
    Claim(
        "stability_arcsec",
        "section 7",
        "attitude stability",
        "0.04",
        "arcsec",
        "it is the residual rate times one second; the angle that this jitter makes is only "
        "{jitter_angle_arcsec:.1e} arcsec, since it turns back 200 times a second",
        assumed=True,
    ),
    Claim(
        "slew_ratio",
        "section 6",
        "rate with over without the platform, slew",
        "3.3",
        "%",
        _ASSUMED + ", nor the guidance; by axis {slew_ratio_x:.2g}, {slew_ratio_y:.2g}, "
        "{slew_ratio_z:.2g} %",
        assumed=True,
    ),
    *(
        Claim(
            f"slew_{axis}",
            "fig. 10",
            f"{name} at the end of the slew",
            printed,
            "°",
            "the target is reached and held",
            rounding=0.05,
        )
        for axis, name, printed in (("x", "roll", "60"), ("y", "pitch", "30"), ("z", "yaw", "-60"))
    ),
)
