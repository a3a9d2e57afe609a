"""A beam that spins up: linear theory from the tangent at its root finds it ever softer, and fails.

A cantilever of 10 m is turned from rest to 6 rad/s in 15 s (Kane, Ryan and Banerjee; Simo and Vu-Quoc). A geometrically
exact beam bends back by 0.5738 m at most; turning steadily it stretches by rho A w^2 L^3 / (3 E A) = 5.1429e-4 m.
"""

from __future__ import annotations

import paraflex as pf
from paraflex.motion import simulate_motion
from paraflex.results import motion_dataset


def main() -> dict[str, float]:
    spin = pf.load("spin_up")
    run = simulate_motion(spin.mechanism.with_geometry("second-order"), 16.0, samples=1601)
    data = motion_dataset(run)
    deepest = float(data["tip_transverse"].min())
    turning = data["time"] > 15.0
    stretch = float(data["tip_axial"].where(turning, drop=True).mean())
    print(f"second order: deepest {deepest:.4f} m, axial displacement at constant speed {stretch:.2e} m")

    try:
        linear = spin.mechanism.with_geometry("linear").with_beams(reference="cantilever")
        simulate_motion(linear, 16.0)
    except pf.NumericalError as error:
        print(f"linear: {str(error).splitlines()[0]}")
    return {"deepest": deepest, "stretch": stretch}


if __name__ == "__main__":
    main()
