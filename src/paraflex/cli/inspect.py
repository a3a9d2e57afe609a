"""`paraflex info`: facts on a mechanism, its frequencies, and whether it is sound; without a name, the library."""

import json
import math
from contextlib import suppress
from typing import Any

import numpy as np

from paraflex.arrays import Array
from paraflex.checks import BALANCED, Examination, check, examine
from paraflex.dynamics import (
    Closure,
    DrivenFreedoms,
    Mobility,
    State,
    System,
    Vibration,
    assembled_position,
    build_system,
    closure_of,
    mobility,
    natural_frequencies,
    static_equilibrium,
    undeformed,
)
from paraflex.dynamics.linearise import LOWEST
from paraflex.dynamics.signals import moment_signals
from paraflex.errors import AssemblyError, InputError, ProportionError
from paraflex.files import Model, library_names, load
from paraflex.findings import Finding, Level
from paraflex.formatting import number, speed_text
from paraflex.mechanism import (
    Actuator,
    AppliedTorque,
    ConstantSpeed,
    Mechanism,
    PointForce,
    PrescribedAngle,
    Relation,
    SumRelation,
    TimeProfile,
    actuator_motors,
    grouped,
    loops,
)
from paraflex.paths import follow_path
from .collected import printed
from .commands.models import InfoRequest
from .inspect_tables import print_facts, print_library
from .request import check_time, requested_model


def frequencies(model: Model, seen: Examination, request: InfoRequest) -> dict[str, Any]:
    """Return natural frequencies with motors held and free, and time, acceleration and equilibrium of their pose."""
    assert seen.chosen is not None
    assert seen.chosen.state is not None
    system, rigid, start, assembly = seen.system, seen.rigid, seen.chosen.state, seen.chosen.assembly
    as_checked = request.at is None and not request.balanced
    motors = list(dict.fromkeys(motor.joint for motor in model.mechanism.motors))
    state = start if request.at is None else _pose_at(model, rigid, start, assembly, request.at, request.path)
    state = undeformed(system, rigid, state)
    if request.balanced:
        try:
            state = static_equilibrium(system, state, motors)
        except AssemblyError as error:
            from paraflex.motion import UNBALANCED

            raise InputError(error.cause, field="--balanced", remedy=UNBALANCED) from error
    held = None
    if motors:
        held = seen.held if as_checked else natural_frequencies(system, state, motors, count=LOWEST)
    free = natural_frequencies(system, state, torque_at=motors, count=LOWEST)
    is_equilibrium = free.acceleration < BALANCED
    return {
        "time": state.time,
        "balanced": request.balanced,
        "acceleration": free.acceleration,
        "is_equilibrium": is_equilibrium,
        "equilibrium_nearby": is_equilibrium or _has_equilibrium(system, state, motors),
        "motors_held_hz": None if held is None else hertz(held.frequencies),
        "motors_free_hz": hertz(free.frequencies),
        "growing": max(_growing(free), 0 if held is None else _growing(held)),
    }


def _has_equilibrium(system: System, state: State, held: list[str]) -> bool:
    """Return whether `--balanced` would find an equilibrium from a pose."""
    try:
        static_equilibrium(system, state, held)
    except AssemblyError:
        return False
    return True


def _pose_at(model: Model, rigid: System, start: State, assembly: str, at: float, path: str | None) -> State:
    """Return the pose of the rigid mechanism at the time `at` [s], on its path or by its prescribed angles."""
    check_time(at)
    if path is not None or model.paths:
        motion = follow_path(model.mechanism, model.path(path), [0.0, at] if at else [0.0], assembly=assembly)
        return State(at, motion.q[-1], np.zeros(rigid.n))
    if rigid.n != rigid.n_constraints:
        raise InputError(
            "the model has no path, and its prescribed angles do not give its pose at later times",
            field="--at",
            value=at,
            remedy="leave it out",
        )
    q = assembled_position(rigid, moment_signals(rigid.mechanism, at), at, start.q)
    return State(at, q, np.zeros(rigid.n))


def _growing(vibration: Vibration) -> int:
    return int(np.sum(vibration.squares < 0.0))


def hertz(omega: Array) -> list[float]:
    """Convert angular frequencies [rad/s] to frequencies [Hz]."""
    return [float(w) / (2.0 * np.pi) for w in omega]


# Largest number of loops and of redundant constraints listed.
_LISTED = 1000


def info_command(request: InfoRequest) -> int:
    """Describe a mechanism, or the library; return the exit code."""
    if request.model.given is None:
        facts: Any = library()
        verdict = None
    else:
        facts = describe(requested_model(request.model), request)
        verdict = facts["verdict"]["level"]
        # The findings are printed with the facts.
        printed(map(Finding.from_dict, facts["verdict"]["findings"]))
    if request.json:
        print(json.dumps(facts, indent=2))
    elif verdict is None:
        print_library(facts)
    else:
        print_facts(facts)
    return 1 if verdict == Level.WRONG.value else 0


def library() -> list[dict[str, Any]]:
    """Return the main facts on every mechanism of the library."""
    facts = []
    for name in library_names():
        model = load(name)
        mechanism, rigid = model.mechanism, build_system(model.mechanism.rigid())
        start = closure_of(rigid, mechanism.assembly(model.study.assembly))
        facts.append(
            {
                "name": name,
                "description": mechanism.description,
                "degrees_of_freedom": None if start.state is None else mobility(rigid, start.state).freedoms,
                "bodies": len(mechanism.bodies),
                "motors": [motor.name for motor in mechanism.motors],
                "paths": list(model.paths),
                "duration": model.study.duration,
            }
        )
    return facts


def describe(model: Model, request: InfoRequest | None = None) -> dict[str, Any]:
    """Return the facts that `paraflex info` prints."""
    request = request or InfoRequest()
    mechanism = model.mechanism
    seen = examine(mechanism, request.assembly or model.study.assembly)
    verdict = check(model, path=request.path, assembly=request.assembly, seen=seen)
    chosen, found = seen.chosen, loops(mechanism)
    facts = {
        **_counts(model, seen.system, seen.rigid),
        "links": _links(mechanism, seen.system),
        "loop_count": len(found),
        "loops": [list(loop) for loop in found[:_LISTED]],
        "starts": [_start_facts(start) for start in seen.starts],
        "assembly": None if chosen is None else chosen.assembly,
        "assembly_closes": None if chosen is None else (chosen.closes or chosen.problem),
        "gruebler_count": seen.rigid.n - seen.rigid.n_constraints,
        "several_paths": not request.path and len(model.study.paths) > 1,
        "verdict": verdict.to_dict(),
    }
    if seen.mobility is None or seen.reach is None:
        return facts | {"degrees_of_freedom": facts["gruebler_count"], "redundant_constraints": []}
    facts |= _mobility_facts(seen.mobility) | {"drives": _reach_facts(seen.reach)}
    # If there are no frequencies, the verdict gives the reason.
    with suppress(ProportionError):
        facts["frequencies"] = frequencies(model, seen, request)
    return facts


def _counts(model: Model, system: System, rigid: System) -> dict[str, Any]:
    mechanism = model.mechanism
    return {
        "name": mechanism.name,
        "source": model.source,
        "description": mechanism.description,
        "bodies": len(mechanism.bodies),
        "joints": len(mechanism.joints),
        "motors": [motor.name for motor in mechanism.motors],
        "following": [motor.name for motor in mechanism.motors if motor.follows],
        "actuators": [_actuator(mechanism, one) for one in mechanism.actuators],
        "prescribed": [_drive(one, "m/s" if mechanism.slides(one.joint) else "rad/s") for one in mechanism.prescribed],
        "loads": [_load(one) for one in mechanism.loads],
        "coordinates": system.n,
        "rigid_coordinates": rigid.n,
        "flexible_coordinates": system.n_flexible,
        "constraints": system.n_constraints,
        "total_mass": system.total_mass,
        "payload": _payload_facts(mechanism),
        "assemblies": [assembly.name for assembly in mechanism.assemblies],
        "modes": [mode.name for mode in mechanism.modes],
        "paths": list(model.paths),
        **{group.plural_noun: list(map(_equation, members)) for group, members in grouped(mechanism) if group.relates},
        "sensors": [sensor.name for sensor in mechanism.sensors],
        "controllers": list(model.controllers),
    }


def _payload_facts(mechanism: Mechanism) -> dict[str, Any] | None:
    carried, effector = mechanism.payload, mechanism.end_effector
    if carried is None or effector is None:
        return None
    numbers = {"mass": carried.mass, "inertia": carried.inertia, "offset": list(carried.offset)}
    return {"point": str(effector.point), **numbers}


def _actuator(mechanism: Mechanism, actuator: Actuator) -> str:
    """Return name and numbers of an actuator for its motors' joints; for both kinds if some turn and some slide."""
    names = actuator_motors(actuator, mechanism)
    kinds = dict.fromkeys(mechanism.slides(motor.joint) for motor in mechanism.motors if motor.name in names)
    return f"{actuator.name}: {'; '.join(actuator.summary(slides=kind) for kind in kinds)}"


def _load(load: PointForce | AppliedTorque) -> str:
    """Return name, kind, components and place of a load; a component that depends on time reads "in time"."""
    parts = [
        number(one) if isinstance(one, int | float) else "in time" if isinstance(one, TimeProfile) else str(one)
        for one in load.components
    ]
    size = f"({', '.join(parts)})" if len(parts) > 1 else parts[0]
    return f"{load.name}: {load.kind} {size} {load.unit} at {load.point}"


def _drive(drive: PrescribedAngle, unit: str) -> str:
    """Return name, joint and speed of a prescribed motion; "in time" if the speed is not constant."""
    profile = drive.profile
    return f"{drive.name}: joint {drive.joint}, " + (
        speed_text(profile.speed, unit) if isinstance(profile, ConstantSpeed) else "in time"
    )


def _equation(one: Relation) -> str:
    """Return a relation as an equation of the joints' coordinates."""
    sign = "-" if one.phase and one.phase < 0.0 else "+"
    if isinstance(one, SumRelation):
        terms = " ".join(f"{weight:+.4g} {joint}" for joint, weight in one.weights.items())
        return f"{one.name}: {terms} = {number(one.phase)}"
    phase = f" {sign} {number(abs(one.phase))}" if one.phase else ""
    return f"{one.name}: {one.second_joint} = {number(one.transmission)} {one.first_joint}{phase}"


def _links(mechanism: Mechanism, system: System) -> list[dict[str, Any]]:
    links = []
    for body in mechanism.bodies:
        parts = [system.body(part) for part in system.parts(body.name)]
        links.append(
            {
                "name": body.name,
                "kind": "flexible" if getattr(body, "flexible", False) else "rigid",
                "length": getattr(body, "length", None),
                "mass": sum(part.integrals.m for part in parts),
                "elements": sum(part.mesh.n_elements for part in parts if part.mesh) or None,
                "frames": len(parts),
                "coordinates": sum(3 + part.nf for part in parts),
                # Frequencies of the first part, held in its own frame.
                "frequencies_hz": hertz(parts[0].modes.omega),
            }
        )
    return links


def _start_facts(start: Closure) -> dict[str, Any]:
    numbers = {name: getattr(start, name) for name in ("gap_before", "position", "velocity", "gap")}
    finite = {name: value if math.isfinite(value) else None for name, value in numbers.items()}
    return {
        "assembly": start.assembly, "closes": start.closes, **finite, "where": list(start.where),
        "problem": start.problem,
    }  # fmt: skip


def _mobility_facts(free: Mobility) -> dict[str, Any]:
    return {
        "rank": free.rank,
        "degrees_of_freedom": free.freedoms,
        "lasting_degrees_of_freedom": free.nearby_freedoms,
        "special_pose": free.special,
        "redundant_constraints": [one.row for one in free.redundant],
        "redundancies": [
            {"row": one.row, "joint": one.joint, "among": list(one.among)} for one in free.redundant[:_LISTED]
        ],
    }


def _reach_facts(drives: DrivenFreedoms) -> dict[str, Any]:
    return {
        "all_motors": drives.all_motors,
        "modes": dict(drives.modes),
        "minimal_sets": [list(motors) for motors in drives.sets],
        "more_sets": drives.more,
    }
