"""Reduction of linear models: modal bases of this or other poses, interpolated bases, and balanced truncation.

Balanced truncation (Moore 1981) is that of the stable part of a model; the remaining part is retained.
"""

from collections.abc import Sequence
from dataclasses import replace
from typing import Any

import numpy as np
import scipy

from paraflex.arguments import checked_arguments
from paraflex.arrays import Array, Indices
from paraflex.dynamics import State
from paraflex.dynamics.state_space import StateSpace
from paraflex.errors import InputError, as_enum
from paraflex.limits import solvable
from paraflex.mechanism import ActuationMode, Mechanism, Start
from paraflex.motion import MotionRun
from paraflex.paths import ModelWithPaths
from paraflex.tracking import TrackingRun, TrackingTask
from .bases import Basis, carried, craig_bampton, independent_rows, interpolated, lowest_modes, rubin
from .coordinates import Variable
from .linearise import linear_model, linearise, operating_point
from .model import LinearModel
from .reduced import ReducedModel, ReductionMethod
from .varying import describes, same_bodies

# Hankel singular values below this fraction of the largest are lost in the rounding of the Gramians.
_RESOLVED = float(np.sqrt(np.finfo(float).eps))
# Poles with a real part above minus this fraction of a low frequency are not stable.
_STABLE = 1e-6


def balanced_truncation(system: StateSpace, count: int, low: float) -> tuple[StateSpace, Array, float]:
    """Truncate the least controllable and observable states of the stable part.

    Parameters
    ----------
    system : StateSpace
        Linear system.
    count : int
        Number of states to retain, including those of the part that is not stable.
    low : float
        Typical low angular frequency [rad/s].

    Returns
    -------
    StateSpace
        Truncated system.
    (stable,) array
        Hankel singular values of the stable part, descending, in units of outputs over inputs.
    float
        Upper bound of the error's largest gain over all frequencies: twice the sum of the truncated values (Enns,
        Glover 1984), with values lost in rounding replaced by the limit of their resolution.

    Raises
    ------
    InputError
        The number is less than that of the states that are not stable, or the system has no stable part.
    """
    free, others = _uncoupled(system.A, low)
    whole = np.eye(len(system.A))
    within, across = whole[others], whole[:, others]
    schur, basis, neutral = scipy.linalg.schur(
        system.A[np.ix_(others, others)], sort=lambda real, _: real > -_STABLE * low
    )
    first = free.size + neutral
    if first > count or first == len(whole):
        raise InputError(
            f"{first} of {len(whole)} states are not damped, and balanced truncation keeps them",
            field="states", value=count,
            remedy="give links damping ([damping], or damping = { ratios = [0.01] }), or choose craig-bampton",
        )  # fmt: skip
    # x = right [z1; z2] decouples the two parts.
    coupling = scipy.linalg.solve_sylvester(
        schur[:neutral, :neutral], -schur[neutral:, neutral:], -schur[:neutral, neutral:]
    )
    right = across @ np.hstack([basis[:, :neutral], basis[:, neutral:] + basis[:, :neutral] @ coupling])
    left = np.vstack([basis[:, :neutral].T - coupling @ basis[:, neutral:].T, basis[:, neutral:].T]) @ within
    stable, inputs, outputs = schur[neutral:, neutral:], left[neutral:] @ system.B, system.C @ right[:, neutral:]
    reached = _root(scipy.linalg.solve_continuous_lyapunov(stable, -inputs @ inputs.T))
    seen = _root(scipy.linalg.solve_continuous_lyapunov(stable.T, -outputs.T @ outputs))
    U, hankel, V = scipy.linalg.svd(seen.T @ reached)
    kept = min(count - first, int(np.sum(hankel > 0.0)))
    root = np.sqrt(hankel[:kept])
    # Projections z = left x and x = right z.
    left = np.vstack([whole[free], left[:neutral], (U[:, :kept] / root).T @ seen.T @ left[neutral:]])
    right = np.hstack([whole[:, free], right[:, :neutral], right[:, neutral:] @ reached @ (V[:kept].T / root)])
    bound = 2.0 * float(np.sum(np.maximum(hankel[kept:], _RESOLVED * hankel.max(initial=0.0))))
    return StateSpace(left @ system.A @ right, left @ system.B, system.C @ right, system.D), hankel, bound


def _uncoupled(A: Array, low: float) -> tuple[Indices, Indices]:
    """Return the states of undamped motions that are not coupled to other states, and all other states.

    Rigid motions are thus retained without a transformation, whose rounding errors would be visible at low frequencies,
    where their gains are large.
    """
    label = scipy.sparse.csgraph.connected_components(scipy.sparse.csr_matrix(A), connection="weak")[1]
    groups = [np.flatnonzero(label == k) for k in range(label.max(initial=-1) + 1)]
    free = [group for group in groups
            if np.all(np.linalg.eigvals(A[np.ix_(group, group)]).real > -_STABLE * low)]  # fmt: skip
    found = np.sort(np.concatenate([np.zeros(0, dtype=int), *free]))
    return found, np.setdiff1d(np.arange(len(A)), found)


def _root(gramian: Array) -> Array:
    """Return a matrix L with L L^T the Gramian, which may be slightly indefinite by rounding."""
    values, vectors = scipy.linalg.eigh(0.5 * (gramian + gramian.T))
    return vectors * np.sqrt(np.maximum(values, 0.0))


# Default number of states of reduced models.
_STATES = 16
# Methods whose bases can be reused at other poses.
CARRIED = (ReductionMethod.CRAIG_BAMPTON, ReductionMethod.RUBIN)

Source = LinearModel | Mechanism | ModelWithPaths | TrackingTask | TrackingRun | MotionRun


@checked_arguments()
@solvable("a reduced model")
def reduce(
    source: Source,
    states: int | None = None,
    *,
    method: ReductionMethod | str | None = None,
    basis: ReducedModel | Sequence[ReducedModel] | None = None,
    part: float | None = None,
    renewed: bool = True,
    feed_through: bool = True,
    mode: str | ActuationMode | None = None,
    at: float | None = None,
    assembly: str | None = None,
    start: Start | State | None = None,
    balanced: bool = False,
) -> ReducedModel:
    """Reduce a linear model to a model with few states.

    Parameters
    ----------
    source : LinearModel, Mechanism, Model, TrackingTask, TrackingRun or MotionRun
        Linear model, or a source from which `linearise` computes it.
    states : int, optional
        Number of states, by default 16 or all if there are fewer; even except for balanced truncation.
    method : str, optional
        Method of reduction. "craig-bampton" (default): static shapes of all motors' coordinates, whatever the mode, and
        of prescribed motions that are inputs, and vibrations with all these held. "rubin": the same static shapes, and
        shapes with which the lowest modes with free motors are exact. "modal": the lowest modes with free motors.
        "balanced": the most controllable and observable states of the stable part, with an error bound.
    basis : ReducedModel or sequence of ReducedModel, optional
        Model reduced by "craig-bampton" or "rubin" at another pose of the mechanism, whose basis is used; or models at
        several poses, between which the basis is interpolated. A mechanism is linearised in their coordinates.
    part : float, optional
        Position among several bases: 0 (default) is the first, 1 the second, 1.5 halfway from the second to the third.
    renewed : bool
        True (default) takes only the vibrations from the basis, and static shapes of this pose: rigid motions and
        stiffness remain exact. False takes the whole basis from the other pose.
    feed_through : bool
        True (default) adds the quasi-static response of the omitted vibrations to the outputs, so that torques have an
        immediate effect `D` on positions, angles and strains. False omits it, so that these are combinations of the
        states. Balanced truncation does not have this part.
    mode, at, assembly, start, balanced
        Operating point, see `linearise`; not admissible for a linear model.

    Returns
    -------
    ReducedModel
        Reduced-order model.

    Raises
    ------
    InputError
        The states are fewer than the motors require or more than the model has; the mechanism has no flexible links;
        it has no damping for balanced truncation; or the basis is of another mechanism, in other coordinates or of a
        pose beyond a singular one.
    AssemblyError
        The mechanism does not reach the pose.
    """
    given = _given(basis, part, states, method)
    options = {"mode": mode, "at": at, "assembly": assembly, "start": start, "balanced": balanced or None}
    model = _linear_model(source, given, {name: value for name, value in options.items() if value is not None})
    if not any(body.nf for body in model.minimal.system.bodies):
        raise InputError(
            "has rigid links only, so that no state can be left out", field="model", value=model.mechanism,
            remedy="give it flexible links",
        )  # fmt: skip
    if given:
        return _carried(model, given, part or 0.0, renewed, feed_through)
    chosen = ReductionMethod.CRAIG_BAMPTON if method is None else as_enum(ReductionMethod, method, "method")
    return _reduced(model, min(_STATES, len(model.states)) if states is None else states, chosen, feed_through)


def _given(
    basis: ReducedModel | Sequence[ReducedModel] | None,
    part: float | None,
    states: int | None,
    method: ReductionMethod | str | None,
) -> list[ReducedModel]:
    """Return the reduced models whose bases are used, checked against the other arguments."""
    given = [] if basis is None else [basis] if isinstance(basis, ReducedModel) else list(basis)
    if not given:
        if basis is not None or part is not None:
            raise InputError("names none", field="basis", remedy="give reduced models of other poses")
        return given
    for name, value in (("states", states), ("method", method)):
        if value is not None:
            raise InputError(f"is that of the basis, {getattr(given[0], name)!r}" if name == "method" else
                             f"are those of the basis, {len(given[0].states)}",
                             field=name, value=str(value), remedy="leave it out")  # fmt: skip
    for one in given:
        if one.method not in CARRIED:
            raise InputError(
                "does not keep the motors' coordinates, by which bases of other poses are taken over", field="basis",
                value=one.method.value, remedy="give one by craig-bampton or rubin",
            )  # fmt: skip
        if one.states != given[0].states or one.full.states != given[0].full.states:
            raise InputError("have different states", field="basis", value=one.full.mechanism,
                             remedy="reduce all in the same way: pf.reduce(mechanism, basis=first)")  # fmt: skip
    last = len(given) - 1
    if not 0.0 <= (part or 0.0) <= last:
        raise InputError("is not between the bases", field="part", value=part, remedy=f"give one from 0 to {last}")
    return given


def _linear_model(source: Source, given: Sequence[ReducedModel], options: dict[str, Any]) -> LinearModel:
    """Return the full model, as given or linearised, in the coordinates of the bases if there are any."""
    if isinstance(source, LinearModel):
        for name, value in options.items():
            raise InputError("has no meaning for a linear model", field=name, value=str(value),
                             remedy="leave it out, or give the mechanism")  # fmt: skip
        if given:
            _check_alike(given[0], source)
        return source
    if not given:
        return linearise(source, **options)
    first, (variables, point, unbalanced) = given[0].full, operating_point(source, **options)
    system = variables.coordinates.system
    same = len(variables.coordinates.measured) > np.max(first.minimal.chosen.joints, initial=-1)
    if not same or not same_bodies(system, first.minimal.system):
        raise _other_mechanism_error(given[0], system.mechanism.name)
    model = linear_model(variables, point, unbalanced, chosen=first.minimal.chosen)
    _check_alike(given[0], model)
    if not describes(model.minimal, first.minimal):
        raise InputError(
            "has coordinates that do not describe the motion in this pose, which lies beyond a singular one",
            field="basis", value=first.mechanism, remedy="give a basis of a nearer pose",
        )  # fmt: skip
    return model


def _check_alike(basis: ReducedModel, model: LinearModel) -> None:
    """Raise an `InputError` for a basis of another mechanism or in other coordinates."""
    if not same_bodies(model.minimal.system, basis.full.minimal.system):
        raise _other_mechanism_error(basis, model.mechanism)
    if basis.full.states != model.states:
        own = {one.name for one in model.states}
        other = next((one.name for one in basis.full.states if one.name not in own), basis.full.states[0].name)
        raise InputError(
            f"has other coordinates than the model, {other} among them", field="basis", value=basis.full.mechanism,
            remedy="give the mechanism in place of its linear model: it is linearised in the coordinates of the basis",
        )  # fmt: skip


def _other_mechanism_error(basis: ReducedModel, mechanism: str) -> InputError:
    return InputError(f"belongs to a mechanism with other bodies or motors than {mechanism}", field="basis",
                      value=basis.full.mechanism, remedy="give one of the same mechanism in another pose")  # fmt: skip


def _carried(
    model: LinearModel, given: Sequence[ReducedModel], part: float, renewed: bool, feed_through: bool
) -> ReducedModel:
    """Reduce the model by the basis of another pose, or by one interpolated between several."""
    first = given[0]
    shapes = interpolated([one.shapes for one in given], first.full.second_order.mass, first.interface, part)
    equations, rows = model.second_order, model.joint_rows([one.name for one in first.states[: first.interface]])
    basis = carried(equations.mass, _symmetric(equations.stiffness), rows, shapes, equations.typical, renewed=renewed)
    space = _projected(model, basis, feed_through)
    return replace(first, full=model, state_space=space, basis=basis.shapes)


def _reduced(model: LinearModel, states: int, method: ReductionMethod, feed_through: bool) -> ReducedModel:
    """Reduce the model by a basis of its own or by balanced truncation."""
    most = len(model.states)
    if not 1 <= states <= most:
        raise InputError("no such number of states", field="states", value=states, remedy=f"choose one up to {most}")
    if method is ReductionMethod.BALANCED:
        return _balanced(model, states)
    if states % 2:
        raise InputError(
            "is odd, but every coordinate brings its rate", field="states", value=states, remedy=f"give {states + 1}"
        )
    basis, names, interface = _basis(model, states // 2, method)
    rates = tuple(Variable(f"{one.name}_rate", f"{one.unit}/s") for one in names)
    space = _projected(model, basis, feed_through)
    return ReducedModel(model, method, (*names, *rates), space, basis=basis.shapes, interface=interface)


def _balanced(model: LinearModel, states: int) -> ReducedModel:
    """Reduce the model by balanced truncation."""
    space, hankel, bound = balanced_truncation(model.scaled, states, model.low_frequency)
    names = tuple(Variable(f"balanced{k + 1}", "1") for k in range(len(space.A)))
    return ReducedModel(model, ReductionMethod.BALANCED, names, space, hankel=hankel, bound=bound)


def _symmetric(stiffness: Array) -> Array:
    return 0.5 * (stiffness + stiffness.T)


def _basis(model: LinearModel, count: int, method: ReductionMethod) -> tuple[Basis, tuple[Variable, ...], int]:
    """Return a basis of `count` coordinates, their names, and the number of those that are joint coordinates."""
    equations = model.second_order
    stiffness = _symmetric(equations.stiffness)
    if method is ReductionMethod.MODAL:
        basis = lowest_modes(equations.mass, stiffness, count, equations.typical)
        return basis, tuple(Variable(f"mode{k + 1}", "m kg^0.5") for k in range(count)), 0
    driven = [one.name for one in model.states[: model.minimal.chosen.joints.size]][-model.minimal.driven :]
    joints = list(dict.fromkeys(motor.joint for motor in model.minimal.system.mechanism.motors))
    joints += [joint for joint in driven if joint not in joints] if model.minimal.driven else []
    rows = model.joint_rows(joints)
    kept = independent_rows(rows, 1.0 / np.sqrt(np.diag(equations.mass)))
    if count < len(kept):
        raise InputError(
            f"are fewer than the {2 * len(kept)} of the coordinates of {len(kept)} motors or drives and their rates",
            field="states", value=2 * count, remedy=f"keep at least {2 * len(kept)}, better {2 * len(kept) + 8}",
        )  # fmt: skip
    mechanism = model.minimal.system.mechanism
    names = [Variable(joints[k], "m" if mechanism.joint(joints[k]).slides else "rad") for k in kept]
    names += [Variable(f"held_mode{k + 1}", "m kg^0.5") for k in range(count - len(kept))]
    make = rubin if method is ReductionMethod.RUBIN else craig_bampton
    basis = make(equations.mass, stiffness, rows[kept], count - len(kept), equations.typical)
    return basis, tuple(names), len(kept)


def _projected(model: LinearModel, basis: Basis, feed_through: bool) -> StateSpace:
    """Project the equations on y = T z, with outputs of y = T z + G (F u - K T z - D T z' - M T z'').

    F u are the forces of the inputs. The flexibility G gives the quasi-static response of the omitted vibrations to
    forces and inertia forces (mode acceleration method, Craig 1981), with which accelerations T z'' and constraint
    forces are in equilibrium. Without feed-through it is omitted in outputs that are positions, angles or strains.
    """
    T, f, k = basis.shapes, len(basis.shapes), basis.shapes.shape[1]
    equations = model.second_order
    full = np.hstack([model.A[f:, :f] @ T, model.A[f:, f:] @ T, model.B[f:]])
    few = scipy.linalg.solve(T.T @ equations.mass @ T, T.T @ equations.mass @ full)
    bent = basis.flexibility @ equations.mass @ (full - T @ few)
    outputs = np.hstack([model.C[:, :f] @ T, model.C[:, f:] @ T, model.D]) + model.C[:, :f] @ bent
    if not feed_through:
        outputs -= model.place_outputs @ bent
    A = np.vstack([np.eye(k, 2 * k, k), few[:, : 2 * k]])
    B = np.vstack([np.zeros((k, few.shape[1] - 2 * k)), few[:, 2 * k :]])
    return StateSpace(A, B, outputs[:, : 2 * k], outputs[:, 2 * k :])
