"""Findings on a model, a study or a result: each has a stable code, a place, a text and a remedy.

`CODES` lists the codes; the documentation page "Findings" is generated from this table.
"""

from collections.abc import Iterable, Mapping, Sequence
from dataclasses import dataclass
from enum import Enum
from typing import Any

from .errors import ModelWarning, ParaflexWarning, printable, warn_user

# Final statuses of a run that did what was asked.
DONE_STATUSES = ("complete", "stopped")
# Largest error of a resolved force, relative to its largest value.
RESOLVED = 0.01

__all__ = ["CODES", "DONE_STATUSES", "Code", "Finding", "Level", "Verdict", "warn_of"]


class Level(Enum):
    """Severity of a finding; a verdict has that of its most severe finding.

    SOUND
        There are no findings.
    DOUBTFUL
        The model runs and may be intended; look at the finding before you trust the numbers.
    WRONG
        The requested result cannot be computed from the model.
    """

    SOUND = "sound"
    DOUBTFUL = "doubtful"
    WRONG = "wrong"


@dataclass(frozen=True)
class Code:
    """Common properties of the findings of one code.

    Attributes
    ----------
    level : Level
        Severity.
    meaning : str
        Description of the condition, for the documentation.
    """

    level: Level
    meaning: str


_WRONG = {
    "assembly-missing": "The model has no assembly, so its configuration is unknown.",
    "assembly-open": "The loops of an assembly cannot be closed with the lengths and places given.",
    "mode-short": "The motors of an actuation mode cannot drive all degrees of freedom.",
    "end-effector-missing": "The study has a path, but the mechanism has no end-effector to follow it.",
    "mode-missing": "The study has a path, but no actuation mode or no motor to drive the mechanism along it.",
    "study-refused": "The study asks for something that the model does not have.",
    "task-freedoms": "A path does not prescribe as many end-effector coordinates as there are degrees of freedom.",
    "start-refused": "The start of a run contradicts the joints, prescribed motions or itself.",
    "out-of-proportion": "Numbers of the model are so far apart that its equations cannot be solved at a pose.",
    "path-unreachable": "The end-effector cannot follow a path of the study, in the assembly of the study.",
    "path-singular": "A mode loses control of the mechanism on the path: a Type II singular position.",
}
_DOUBTFUL = {
    "special-pose": "The pose of an assembly has degrees of freedom that its neighbours lack: a change point.",
    "assembly-elbow": "An assembly closed far from the given angles: it may be the other elbow.",
    "assembly-moved": "The loops of an assembly do not close with its drive where it was given, but beside it.",
    "beam-thick": "A beam is nearly as thick as it is long, or thicker: a section in millimetres, or turned.",
    "beam-thin": "A beam is thinner than a ten-thousandth of its length.",
    "beam-overhang": "Most of a beam lies beyond its named points.",
    "section-turned": "A rectangular section is several times as thick in the plane as it is wide out of it.",
    "modulus": "Young's modulus is outside the range of materials: it is given in Pa.",
    "density": "A density is outside the range of materials: it is given in kg/m^3.",
    "material": "Modulus and density are inconsistent: no material has such a speed of sound.",
    "mass": "A mass or inertia is out of proportion to the mechanism: it is given in kg, or kg m^2.",
    "angle": "An angle is beyond a full turn: it is given in radians.",
    "size": "Lengths are out of proportion: the mechanism is very large, very small, or in mixed units.",
    "unused": "A parameter, section, material, lumped mass, ground point or torque that nothing uses.",
    "gravity": "Gravity is not 9.81 m/s^2 along an axis.",
    "same-place": "Two points of a body, or two ground points, coincide.",
    "joint-twice": "Two joints join the same two points.",
    "joint-missing": "Two points of the same name almost coincide, but no joint connects them.",
    "point-unused": "Two joints hold the same point of a body, and none holds the point with the name of one of them.",
    "motor-shared": "Two motors act at one joint.",
    "motor-prescribed": "A motor acts at a joint whose motion is prescribed: it has no effect.",
    "friction-large": "Friction at a joint exceeds the torque or force of its motor, or the weight of all bodies.",
    "friction-sharp": "The speed of a friction law is so small that steps collapse.",
    "damping-large": "A structural damping ratio is implausibly large: it is a fraction, not a percentage.",
    "spring-idle": "A spring lies between points that joints hold together.",
    "spring-rest": "A linear spring has no free length in the file, which makes it zero.",
    "load-large": "A load is far beyond the weight of all bodies.",
    "duration-missing": "The model has no path and no statics, and its study has no duration.",
    "duration-long": "The run goes on for very long after the path.",
    "samples-few": "There are too few samples to resolve the turns of a prescribed motion.",
    "loop-unstable": "Sampled controllers are unstable with the linear model of all states.",
    "samples-coarse": "Stresses, joint forces or torques of drives are larger between the samples that are kept.",
    "path-idle": "A path moves only along a coordinate that is not a task of the end-effector.",
    "path-cut-short": "The run ends before the path does.",
    "law-cut-short": "The run ends before the pieces or the table of a prescribed motion do.",
    "path-fast": "A path asks for a speed or an acceleration that no such machine reaches.",
    "path-ill-conditioned": "A mode passes near a singular position of its motors.",
    "reduced-too-far": "A run with few flexible coordinates is far from the run with all of them.",
    "reduced-beyond-plan": "A run with few flexible coordinates bends beams far more than its plan did.",
    "reduced-jumps": "Loads jump in a run with few flexible coordinates: joint forces and stresses are uncertain.",
    "modes-too-stiff": "The modes kept of a beam cannot represent a moment applied to it.",
    "equilibrium-unstable": "A static equilibrium is unstable: the mechanism would move away from it.",
    "laws-without-energy": "Forces over the motion have no energy: frequencies and stability leave out a part of them.",
    "motions-grow": "Some motions about the pose grow instead of vibrating.",
    "axis-along-beam": "A slot or prismatic joint has its straight axis along a flexible beam.",
    "elements-few": "Elements of a beam are too long for a joint that slides along it, or for fast loads or profiles.",
    "slider-off-beam": "A sliding joint leaves its beam.",
    "frequency-low": "The natural frequency of a link is implausibly low.",
    "torque-large": "Torques or forces are far beyond what mass, size and speed make plausible.",
    "force-large": "Forces of joints or drives are far beyond what mass, acceleration and loads make plausible.",
    "loads-unbounded": "Forces of joints grow without bound towards a change point, where assemblies meet.",
    "loads-undetermined": "Redundant constraints leave forces or moments of joints undetermined.",
    "stress-over-strength": "The stress in a beam exceeds the strength of its material: the safety factor is below 1.",
    "deflection-large": "A link bends so far that it is more a spring than a link.",
    "energy-unbalanced": "Energy and work of a run do not balance: it is not accurate, or unstable.",
    "errors-grow": "A free motion amplifies small errors so much that another tolerance gives another motion.",
    "forces-unresolved": "Forces of joints or drives may be off by more than 1 % of their largest values.",
    "speed-large": "A body moves, or a drive turns, implausibly fast.",
    "amplifier-beyond": "A motor needs more current or voltage than its amplifier supplies.",
    "back-emf-passive": "A motor that a mode leaves passive brakes its joint by back-EMF, at zero voltage.",
    "back-emf-late": "Back-EMF acts at once, although the inductance of the winding would delay it noticeably.",
    "error-large": "The tracking error is as large as the path.",
    "tolerance-loose": "The tolerance is a large part of the mechanism's size: positions may be off by as much.",
    "stability": "An explicit method takes very many steps, which stability alone requires.",
    "validity": "A run went beyond what the geometry of its model can describe.",
}
CODES: dict[str, Code] = {name: Code(Level.WRONG, text) for name, text in _WRONG.items()} | {
    name: Code(Level.DOUBTFUL, text) for name, text in _DOUBTFUL.items()
}


@dataclass(frozen=True)
class Finding:
    """One reason why a model is doubtful or wrong, or a result doubtful.

    Attributes
    ----------
    code : str
        Key of the table `CODES`, the same in all versions.
    place : str
        Table or field of the model file concerned ("body.crank.section"), or the mode of a run.
    text : str
        Description of the finding, with numbers and units.
    remedy : str
        Advice: where to look, or what to write instead.
    """

    code: str
    place: str
    text: str
    remedy: str

    def __post_init__(self) -> None:
        if self.code not in CODES:
            raise KeyError(f"no finding has the code {self.code!r}")
        # A text taken from a numerical error may end with the same remedy.
        object.__setattr__(self, "text", self.text.removesuffix(f"; {self.remedy}"))

    @property
    def level(self) -> Level:
        """Severity of the finding."""
        return CODES[self.code].level

    def __str__(self) -> str:
        where = f"{self.place}: " if self.place else ""
        return printable(f"{where}{self.text}; {self.remedy} [{self.code}]")

    def to_dict(self) -> dict[str, str]:
        """Return code, level, place, text and remedy as a dictionary for JSON."""
        texts = {"place": self.place, "text": self.text, "remedy": self.remedy}
        return {"code": self.code, "level": self.level.value, **texts}

    @classmethod
    def from_dict(cls, kept: Mapping[str, str]) -> "Finding":
        """Return the finding from a dictionary made by `to_dict`."""
        return cls(kept["code"], kept["place"], kept["text"], kept["remedy"])


@dataclass(frozen=True)
class Verdict(Sequence[Finding]):
    """Findings of a check, the most severe first.

    Attributes
    ----------
    findings : tuple of Finding
        Findings without duplicates, sorted by severity.
    """

    findings: tuple[Finding, ...]

    def __init__(self, findings: Iterable[Finding] = ()) -> None:
        once = {(one.code, one.place, one.text): one for one in findings}.values()
        object.__setattr__(self, "findings", tuple(sorted(once, key=lambda one: one.level is not Level.WRONG)))

    @property
    def level(self) -> Level:
        """Level of the most severe finding; sound if there is none."""
        return self.findings[0].level if self.findings else Level.SOUND

    @property
    def codes(self) -> tuple[str, ...]:
        """Codes of all findings."""
        return tuple(one.code for one in self.findings)

    def to_dict(self) -> dict[str, Any]:
        """Return `level` and `findings` as a dictionary for JSON."""
        return {"level": self.level.value, "findings": [one.to_dict() for one in self.findings]}

    def __getitem__(self, k: Any) -> Any:
        return self.findings[k]

    def __len__(self) -> int:
        return len(self.findings)

    def __str__(self) -> str:
        return "\n".join([f"{one.level.value}: {one}" for one in self.findings] or [Level.SOUND.value])


def warn_of(findings: Iterable[Finding], category: type[ParaflexWarning] = ModelWarning) -> None:
    """Issue a warning of the class `category` for each finding, with the finding as its attribute `finding`."""
    for one in findings:
        warning = category(str(one))
        warning.finding = one
        warn_user(warning)
