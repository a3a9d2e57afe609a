"""RAParM-I built in Python: the redundantly actuated 2-DOF parallel manipulator with parallelogram branches.

Two arms A_i B_i C meet at the end-effector C. Beside each arm is a branch D_i E_i F_i with links parallel to those of
the arm, so that the distal link 4 (8) can be driven from the base as well (Figs. 2, 8 and 9 of the paper).
"""

from math import pi

from paraflex.arguments import checked_arguments
from paraflex.fem import ReferenceCondition
from .bodies import Curvature, FlexibleBeam, LumpedMass, Material, Section
from .joints import Motor, PointRef, RevoluteJoint
from .mechanism import Mechanism
from .members import ActuationMode, Assembly, EndEffector, Geometry

# Table 1: signs of the motors tau1 (A1B1), tau2 (D1E1), tau5 (A2B2), tau6 (D2E2).
TABLE_1 = ("+-+-", "-+-+", "+--+", "-++-", "+++-", "++-+", "+-++", "-+++", "++++")
MOTORS = ("tau1", "tau2", "tau5", "tau6")


@checked_arguments()
def raparm_i(
    *,
    e: float = 0.100,
    l1: float = 0.250,
    la: float = 0.100,
    l2: float = 0.250,
    section: Section = Section.rectangle(width=0.030, thickness=0.005),
    material: Material = Material(youngs_modulus=70e9, density=2700.0),
    joint: tuple[float, float] = (0.130, 2.0e-5),
    end: tuple[float, float] = (0.225, 2.5e-5),
) -> Mechanism:
    """Build RAParM-I as in the paper; the defaults are the reference set, identified from the paper's results.

    The model has linear geometry, cantilever frames and shared curvature. A better model of the same manipulator is
    `raparm_i().with_geometry("second-order").with_beams(reference=ReferenceCondition.PINNED,
    curvature=Curvature.SEPARATE)`.

    Parameters
    ----------
    e : float
        Half the distance of the base pivots [m].
    l1 : float
        Length of links 1, 5 (A_i B_i) and 3, 7 (E_i F_i) [m].
    la : float
        Length of links 2, 6 (D_i E_i), and distance B_i F_i on links 4, 8 [m].
    l2 : float
        Length of links 4, 8 (B_i C) [m].
    section, material
        Cross-section and material of all eight links.
    joint : (mass, moment of inertia)
        Lump at both ends of every link and at F_i of links 4, 8, except at C [kg, kg m^2].
    end : (mass, moment of inertia)
        Lump at the C end of links 4 and 8, each [kg, kg m^2].
    """

    def link(number: int, points: dict[str, float], elements: int | tuple[int, ...]) -> FlexibleBeam:
        lumps = tuple(LumpedMass(p, *(end if p == "C" else joint)) for p in points)
        length = max(points.values())
        return FlexibleBeam(
            f"link{number}", length, section, material, points, elements, lumps,
            reference=ReferenceCondition.CANTILEVER, curvature=Curvature.SHARED,
        )  # fmt: skip

    bodies, joints, motors = [], [], []
    for side, first in ((1, 1), (2, 5)):
        a, b, d, f, g = (f"{letter}{side}" for letter in "ABDEF")
        one, two, three, four = (f"link{first + k}" for k in range(4))
        bodies += [
            link(first, {a: 0.0, b: l1}, 3),
            link(first + 1, {d: 0.0, f: la}, 1),
            link(first + 2, {f: 0.0, g: l1}, 3),
            link(first + 3, {b: 0.0, g: la, "C": l2}, (1, 2)),
        ]
        joints += [
            RevoluteJoint(a, PointRef("ground", a), PointRef(one, a)),
            RevoluteJoint(b, PointRef(one, b), PointRef(four, b)),
            RevoluteJoint(d, PointRef("ground", a), PointRef(two, d)),
            RevoluteJoint(f, PointRef(two, f), PointRef(three, f)),
            RevoluteJoint(g, PointRef(three, g), PointRef(four, g)),
        ]
        motors += [Motor(MOTORS[2 * side - 2], a), Motor(MOTORS[2 * side - 1], d)]
    joints.append(RevoluteJoint("C", PointRef("link4", "C"), PointRef("link8", "C")))
    return Mechanism(
        name="RAParM-I",
        geometry=Geometry.LINEAR,
        ground={"A1": (-e, 0.0), "A2": (e, 0.0)},
        bodies=tuple(bodies),
        joints=tuple(joints),
        motors=tuple(motors),
        end_effector=EndEffector(PointRef("link4", "C")),
        assemblies=tuple(_assembly(name, left, right) for name, (left, right) in _ELBOWS.items()),
        modes=tuple(
            ActuationMode(signs, tuple(m for m, sign in zip(MOTORS, signs, strict=True) if sign == "+"))
            for signs in TABLE_1
        ),
    )


# Proximal and distal angle of each arm [degrees] near the centre of the workspace, for the four elbow configurations:
# B1 left of the line A1 C and B2 right of A2 C is "outward".
_LEFT = {"outward": (124.0, 14.0), "inward": (14.0, 124.0)}
_RIGHT = {name: tuple(180.0 - angle for angle in angles) for name, angles in _LEFT.items()}
_ELBOWS = {
    "outward": (_LEFT["outward"], _RIGHT["outward"]),
    "inward": (_LEFT["inward"], _RIGHT["inward"]),
    "left": (_LEFT["outward"], _RIGHT["inward"]),
    "right": (_LEFT["inward"], _RIGHT["outward"]),
}


def _assembly(name: str, left: tuple[float, ...], right: tuple[float, ...]) -> Assembly:
    angles = {}
    for first, (proximal, distal) in ((1, left), (5, right)):
        # Links 1 and 3 are parallel, and so are 2 and 4: two parallelograms D_i E_i F_i B_i.
        for offset, degrees in enumerate((proximal, distal, proximal, distal)):
            angles[f"link{first + offset}"] = round(degrees * pi / 180.0, 3)
    return Assembly(name, angles)
