"""A five-bar written in Python instead of a file: sound or not, torques, and how far it misses its circle."""

from __future__ import annotations

from math import pi

import paraflex as pf
from paraflex.dynamics import build_system, consistent_state, natural_frequencies
from paraflex.mechanism import (
    Assembly,
    EndEffector,
    FlexibleBeam,
    LumpedMass,
    Material,
    Motor,
    PointRef,
    RevoluteJoint,
    Section,
)

STEEL = Material(youngs_modulus=210e9, density=7850.0)
BAR = Section.rectangle(width=0.020, thickness=0.004)
BASE, PROXIMAL, DISTAL = 0.080, 0.180, 0.220  # m


def five_bar() -> pf.Mechanism:
    """Two arms A_i B_i C of slender steel bars, motors at A1 and A2."""

    def link(name: str, length: float, first: str, last: str, tool: float = 0.0) -> FlexibleBeam:
        lumps = (LumpedMass(first, 0.05), LumpedMass(last, 0.05 + tool))
        return FlexibleBeam(name, length, BAR, STEEL, points={first: 0.0, last: length}, elements=3, lumps=lumps)

    links = (
        link("proximal1", PROXIMAL, "A1", "B1"),
        link("distal1", DISTAL, "B1", "C", tool=0.2),
        link("proximal2", PROXIMAL, "A2", "B2"),
        link("distal2", DISTAL, "B2", "C"),
    )
    chain = ("ground.A1", "proximal1.A1"), ("proximal1.B1", "distal1.B1"), ("distal1.C", "distal2.C")
    chain += ("distal2.B2", "proximal2.B2"), ("proximal2.A2", "ground.A2")
    joints = [RevoluteJoint(a.split(".")[1], PointRef.parse(a), PointRef.parse(b)) for a, b in chain]
    return pf.Mechanism(
        name="five-bar in Python",
        ground={"A1": (-BASE, 0.0), "A2": (BASE, 0.0)},
        bodies=links,
        joints=tuple(joints),
        motors=(Motor("left", "A1"), Motor("right", "A2")),
        end_effector=EndEffector(PointRef("distal1", "C")),
        assemblies=(Assembly("elbows out", {"proximal1": 2.2, "distal1": 0.6, "proximal2": 0.9, "distal2": 2.5}),),
    )


def main() -> dict[str, float]:
    mechanism = five_bar()
    system = build_system(mechanism)
    state = consistent_state(system, mechanism.assemblies[0])
    lowest = natural_frequencies(system, state, held=[motor.joint for motor in mechanism.motors]).frequencies[0]
    print(f"motors held, it vibrates at {lowest / (2 * pi):.1f} Hz")

    circle = pf.Circle(centre=(0.0, 0.280), radius=0.030, max_acceleration=30.0)
    task = pf.plan(mechanism, circle, duration=0.5)
    run = task.simulate("++")
    data = pf.tracking_dataset([run])
    error, torque = float(data["tracking_rms_motion"][0]), float(data["peak_torque"].max())
    print(f"circle of 30 mm: error {1e3 * error:.3f} mm, torque up to {torque:.2f} N m")
    return {"frequency": float(lowest / (2 * pi)), "error": error, "torque": torque}


if __name__ == "__main__":
    main()
