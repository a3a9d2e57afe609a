"""Numbers of a pose for the page: freedoms, singular positions, frequencies, compliance, holding torques, modes."""

from collections.abc import Sequence
from contextlib import suppress
from dataclasses import replace
from functools import cached_property
from typing import Any

import numpy as np

from paraflex.actuation.allocation import motor_rows
from paraflex.arrays import Array, ArrayLike, Mask
from paraflex.dynamics import System, acting_loads, build_system, undeformed
from paraflex.dynamics.joint_coordinates import joint_rows
from paraflex.dynamics.linearise import LOWEST, PoseMatrices, compliance, pose_matrices, vibration_about
from paraflex.dynamics.points import marker_place
from paraflex.dynamics.state import State
from paraflex.dynamics.stiffness import RestingForces
from paraflex.errors import InputError, NumericalError, ParaflexError, listed
from paraflex.files import Model
from paraflex.mechanism import Mechanism
from paraflex.mechanism.masses import check_masses, with_any_masses
from paraflex.paths import Path
from paraflex.paths.closure import PathClosure, RigidMotion, follow_path

# Singular values below this fraction of the largest count as zero; frequencies that are shown.
_DEPENDENT, _SHOWN = 1e-9, 3
# Ratio of singular values below which a position counts as near a singular one, and numbers of places of a path
# that is followed, and of one that leaves the reach.
NEAR, _PLACES, _SEARCHED = 0.05, 120, 40
# Largest velocity by unit motions of one body below which all are small, as with all legs stretched.
_SMALL = 0.5
_NOT, _NEAR, _WELL = 0, 2, 1


class Seeing:
    """Numbers of the poses of one model; what does not depend on the pose is computed once.

    Parameters
    ----------
    model : Model
        Model; bodies may lack masses.
    before : Seeing, optional
        Numbers of the model before a change, whose bodies are reused where they did not change.
    """

    def __init__(self, model: Model, before: "Seeing | None" = None) -> None:
        self._model = model
        self._like: System | None = None if before is None else vars(before).get("_flexible")
        # Prescribed motions are motors that hold their joints at any pose.
        self._mechanism: Mechanism = replace(model.mechanism, prescribed=())
        self._drives = [one.joint for one in model.mechanism.prescribed]
        self._joint = {motor.name: motor.joint for motor in self._mechanism.motors}
        self._paths: dict[tuple[str, str], list[list[float]]] = {}

    @cached_property
    def _rigid(self) -> System:
        return build_system(with_any_masses(self._mechanism).rigid())

    @cached_property
    def _flexible(self) -> System:
        # A link whose length has changed may have another mesh, and then another system.
        with suppress(InputError):
            return build_system(self._mechanism, like=self._like)
        return build_system(self._mechanism)

    @cached_property
    def massless(self) -> str:
        """Reason why nothing that depends on masses is known; empty if it is known."""
        try:
            check_masses(self._mechanism)
        except InputError as error:
            return f"{error.field} {error.problem.partition(',')[0]}"
        return ""

    def holds(self, q: Array, mode: str = "") -> bool:
        """Return whether motors of a mode and prescribed motions hold all degrees of freedom in a rigid pose (n,)."""
        free = self._free(q)
        return self._driven(q, mode, free) == free.shape[1]

    def _driven(self, q: Array, mode: str, free: Array) -> int:
        """Return how many of the free motions the motors of a mode and prescribed motions drive."""
        return _rank(self._scaled(joint_rows(self._rigid, self._held(mode), q)) @ free)

    def quick(self, q: Array, mode: str) -> dict[str, Any]:
        """Return the numbers of a rigid pose (n,) that follow a drag.

        The dict has `freedoms`; `mode`; `drives`, how many freedoms the motors of the mode drive; `condition` of the
        effort in the task by these motors (`actuation.actuation_condition`); `serial` and `parallel`, ratios of the
        smallest to the largest singular value of the velocities of the end-effector and of the motors, by all motions
        of unit length, zero in singular positions of types I and II; `torques`, those of least norm that hold gravity,
        springs and loads of t = 0 at rest [N m, N], by motors and by joints of prescribed motions; and `why`, reasons
        for those that are None. A positive torque acts on the second body of its joint.
        """
        why: dict[str, str] = {}
        motors, free = self._motors(mode), self._free(q)
        by_motors, by_task = self._moved(q, motors, free)
        found = {"freedoms": free.shape[1], "mode": mode, "drives": int(_rank(by_motors))}
        found |= self._singular(q, motors)
        found["condition"], reason = _condition(by_task, by_motors)
        if reason:
            why["condition"] = reason
        found["torques"] = self._holding(q, free, by_motors, [*motors, *self._drives], why)
        return {**found, "why": why}

    def _moved(self, q: Array, motors: Sequence[str], free: Array) -> tuple[Array, Array | None]:
        """Return the velocities of motors and drives, and of the task, by the free motions."""
        joints = [*(self._joint[name] for name in motors), *self._drives]
        by_task = self._task(self._rigid, q)
        by_motors = self._scaled(joint_rows(self._rigid, joints, q)) @ free
        return by_motors, None if by_task is None else self._scaled(by_task) @ free

    def _singular(self, q: Array, motors: Sequence[str]) -> dict[str, float | None]:
        """Return the distances from singular positions of types II, parallel, and I, serial; see `quick`."""
        free = self._free(q)
        by_motors, by_task = self._moved(q, motors, free)
        count = free.shape[1]
        task, bodies = 0 if by_task is None else min(len(by_task), count), len(self._rigid.bodies)
        return {
            "parallel": float(_ratio(by_motors, count, bodies)) if len(by_motors) >= count > 0 else None,
            "serial": None if by_task is None or not task else float(_ratio(by_task / self._rigid.size, task, bodies)),
        }

    def full(self, q: Array, mode: str) -> dict[str, Any]:
        """Return all numbers of a rigid pose (n,): those of `quick`, frequencies, compliance, chips and the path.

        `held` and `unheld` are the lowest natural frequencies with the motors of the mode held, and with all motors
        free [Hz]; `compliance` of the end-effector, with the motors of the mode held, has semi-axes `sizes` [m/N] and
        the direction `angle` of the larger [rad]; `chips` have name, motors, number of freedoms driven, and what is
        lacking; `path` is that of `reach`, None if it has not been asked for, and `path_name` its name.
        """
        found = self.quick(q, mode)
        why, massless = found["why"], self.massless
        found |= {"held": None, "unheld": None, "compliance": None, "chips": self._chips(q)}
        found |= {"path": self._known_reach(mode), "path_name": self._model.path_name() if self._is_planned else ""}
        if massless:
            return {**found, "why": {**why, "held": massless, "compliance": massless}}
        try:
            state = undeformed(self._flexible, self._rigid, State(0.0, q, np.zeros(self._rigid.n)))
            held = self._held(mode)
            at = pose_matrices(self._flexible, state, held)
            if varying := [one.name for one in self._mechanism.loads if one.profiles]:
                why["loads"] = f"frequencies and compliance leave out loads that vary in time: {listed(varying)}"
            found["held"] = self._frequencies(state, at, held) if held else None
            free = len(held) > len(self._drives) or not held
            found["unheld"] = self._frequencies(state, at, self._drives) if free else None
            found["compliance"] = self._compliance(q, state, at, mode, why)
        except (InputError, NumericalError) as error:
            why["held"] = str(error)
        return found

    def _frequencies(self, state: State, at: PoseMatrices, held: Sequence[str]) -> list[float]:
        found = vibration_about(self._flexible, state, at, held, count=LOWEST)
        return [float(omega) / (2.0 * np.pi) for omega in found.frequencies if omega > 0.0][:_SHOWN]

    def _compliance(
        self, q: Array, state: State, at: PoseMatrices, mode: str, why: dict[str, str]
    ) -> dict[str, Any] | None:
        rows = self._task(self._flexible, state.q, place=True)
        if rows is None or not self._flexible.n_flexible:
            why["compliance"] = "no end-effector" if rows is None else "no flexible link"
            return None
        if not self.holds(q, mode):
            why["compliance"] = "these motors do not hold the mechanism"
            return None
        found = compliance(self._flexible, state, at, self._held(mode), rows)
        sizes, axes = np.linalg.eigh(0.5 * (found + found.T))
        return {"sizes": [float(sizes[1]), float(sizes[0])], "angle": float(np.arctan2(axes[1, 1], axes[0, 1]) % np.pi)}

    def _motors(self, mode: str) -> tuple[str, ...]:
        chosen = [one.motors for one in self._mechanism.modes if one.name == mode]
        return chosen[0] if chosen else tuple(motor.name for motor in self._mechanism.motors)

    def _held(self, mode: str) -> list[str]:
        """Return the joints that the motors of a mode and prescribed motions hold."""
        return list(dict.fromkeys([*(self._joint[name] for name in self._motors(mode)), *self._drives]))

    def _free(self, q: Array) -> Array:
        """Return a basis (n, freedoms) of the motions that the joints allow, dimensionless and of unit length."""
        jacobian = self._rigid.dimensionless_jacobian(q)
        if not jacobian.size:
            return np.eye(self._rigid.n)
        _, sizes, right = np.linalg.svd(jacobian)
        return right[int(np.sum(sizes > _DEPENDENT * np.max(sizes, initial=0.0))) :].T

    def _scaled(self, rows: Array) -> Array:
        return rows * self._rigid.units

    def _task(self, system: System, q: Array, *, place: bool = False) -> Array | None:
        """Return the derivatives of the task coordinates, or of x and y; None without an end-effector."""
        effector = self._mechanism.end_effector
        if effector is None:
            return None
        rows = marker_place(system, system.marker(effector.point), q[None])[1][0]
        if place:
            return rows
        turn = np.zeros((1, system.n))
        if not effector.point.on_ground:
            turn[0, system.body(effector.point.body).angle] = system.size
        return np.vstack([rows, turn])[[("x", "y", "angle").index(one) for one in effector.coordinates]]

    def _holding(
        self, q: Array, free: Array, by_motors: Array, names: list[str], why: dict[str, str]
    ) -> dict[str, float] | None:
        if self.massless:
            why["torques"] = self.massless
            return None
        system = self._rigid
        forces = RestingForces(system, 0.0)
        forces.torques = acting_loads(system.mechanism, np.zeros(1))[0]
        needed = free.T @ (system.units * forces(q, forces.compliant(q))[0])
        torques = np.linalg.pinv(by_motors.T) @ needed
        left = float(np.max(np.abs(by_motors.T @ torques - needed), initial=0.0))
        if left > 1e-9 * max(1.0, float(np.max(np.abs(needed), initial=0.0))):
            why["torques"] = "the motors cannot hold the mechanism at rest here"
            return None
        return {name: float(torque) for name, torque in zip(names, torques, strict=True)}

    def _chips(self, q: Array) -> list[dict[str, Any]]:
        """Return the modes with what their motors drive at a pose."""
        free, out = self._free(q), []
        for mode in self._mechanism.modes:
            driven, freedoms = self._driven(q, mode.name, free), free.shape[1]
            lacks = f"drives {driven} of {freedoms} degrees of freedom" if driven < freedoms else ""
            out.append({"name": mode.name, "motors": list(mode.motors), "drives": driven, "lacks": lacks})
        return out

    @property
    def _is_planned(self) -> bool:
        return self._mechanism.end_effector is not None and bool(self._model.paths)

    def _known_reach(self, mode: str) -> list[list[float]] | None:
        return self._paths.get((self._model.path_name(), mode)) if self._is_planned else []

    def reach(self, mode: str) -> list[list[float]]:
        """Return places of the study's path as [x, y, reach]: 0 out of reach, 1 reached, 2 near a singular position.

        There are none if the path cannot be tried.
        """
        found = self._known_reach(mode)
        if found is None:
            found, name = list[list[float]](), self._model.path_name()
            with suppress(ParaflexError):
                found = self._reached(self._model.path(name), mode)
            self._paths[name, mode] = found
        return found

    def _reached(self, path: Path, mode: str) -> list[list[float]]:
        mechanism = with_any_masses(self._model.mechanism)
        assembly = mechanism.assembly(self._model.study.assembly)
        orientation = self._model.study.orientation or 0.0
        with suppress(ParaflexError):
            times = np.linspace(0.0, path.duration, _PLACES)
            motion = follow_path(mechanism, path, times, assembly=assembly, orientation=orientation)
            return _places(path, times, np.where(self._near(motion, mode), _NEAR, _WELL))
        closure = PathClosure(mechanism.rigid(), orientation, path.duration)
        times = np.linspace(0.0, path.duration, _SEARCHED)
        found = closure.reach.tracked(times, closure.target(path, times)[:, 0], closure.assembled(assembly))
        return _places(path, times, [_NOT if one.part else _WELL for one in found])

    def _near(self, motion: RigidMotion, mode: str) -> Mask:
        """Return where the mechanism is near a singular position along a motion (k,)."""
        effector, system = self._mechanism.end_effector, motion.system
        assert effector is not None
        sizes = [1.0 if one == "angle" else system.size for one in effector.coordinates]
        free, per_task = np.linalg.qr(motion.basis / system.units[:, None] * sizes)
        driven = [motor.name in self._motors(mode) for motor in self._mechanism.motors]
        near = _ratio(np.linalg.inv(per_task), len(sizes), len(system.bodies)) < NEAR
        if sum(driven) < len(sizes):
            return near
        by_motors = np.swapaxes(motor_rows(motion)[:, :, driven] * system.units[:, None], 1, 2) @ free
        return near | (_ratio(by_motors, len(sizes), len(system.bodies)) < NEAR)


def _places(path: Path, times: Array, reach: ArrayLike) -> list[list[float]]:
    return np.column_stack([path.evaluate(times).position, reach]).tolist()


def _rank(rows: Array) -> int:
    """Return the rank of rows by motions of unit length."""
    return int(np.sum(np.linalg.svd(rows, compute_uv=False) > 1e-7)) if rows.size else 0


def _ratio(rows: Array, count: int, bodies: int) -> Array:
    """Return the singular value of a number over the largest (...,), of rows (..., k, motions) by unit motions."""
    sizes = np.linalg.svd(rows, compute_uv=False)
    return sizes[..., count - 1] / np.maximum(sizes[..., 0], _SMALL / np.sqrt(bodies))


def _condition(by_task: Array | None, by_motors: Array) -> tuple[float | None, str]:
    """Return the condition number of the effort in the task per torque; or None, and the reason."""
    freedoms = by_motors.shape[1]
    if by_task is None:
        return None, "no end-effector"
    if not freedoms:
        return None, "no degree of freedom"
    if not by_motors.size:
        return None, "no motors"
    if len(by_task) != freedoms:
        many = "1 degree" if freedoms == 1 else f"{freedoms} degrees"
        task = "coordinate" if len(by_task) == 1 else "coordinates"
        return None, f"the task has {len(by_task)} {task}, the mechanism {many} of freedom"
    if np.linalg.matrix_rank(by_task) < freedoms:
        return None, "the end-effector is in a singular position (serial, type I)"
    if len(by_motors) < freedoms:
        return None, f"the motors drive {_rank(by_motors)} of {freedoms} degrees of freedom"
    sizes = np.linalg.svd(np.linalg.solve(by_task.T, by_motors.T), compute_uv=False)
    if not sizes[freedoms - 1] > 0.0:
        return None, "the motors are in a singular position (parallel, type II)"
    return float(sizes[0] / sizes[freedoms - 1]), ""
