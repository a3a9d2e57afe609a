"""Flywheel that keeps the speed of a drive within a given fluctuation, from the torque over a turn."""

from dataclasses import dataclass

import numpy as np
import scipy

from paraflex.arguments import checked_arguments
from paraflex.dynamics.joint_loads import drive_torques
from paraflex.errors import InputError
from .motion import DrivenMotion

# Mean torques below this part of the largest torque are rounding errors.
_ROUNDING = 1e-12
# Largest change of the torque over a turn, as a part of the largest torque, and largest relative error of the inertia.
_REPEATED, _COARSE = 1e-6, 0.05


@dataclass(frozen=True)
class Flywheel:
    """Flywheel on the axis of a drive.

    Attributes
    ----------
    inertia : float
        Moment of inertia [kg m^2] for the fluctuation, without that of the drive's own body.
    fluctuation : float
        Coefficient of fluctuation: range of the speed over its mean.
    energy : float
        Largest difference of the energy exchanged within a turn [J].
    mean_torque : float
        Mean torque of the drive [N m].
    error : float
        Difference of the inertia from that of half as many samples [kg m^2].
    """

    inertia: float
    fluctuation: float
    energy: float
    mean_torque: float
    error: float


@checked_arguments()
def flywheel(motion: DrivenMotion, fluctuation: float) -> Flywheel:
    """Compute the flywheel of a drive that makes a whole turn.

    The energy is the range of the integral of torque less mean torque over the angle, E; the inertia is
    E / (fluctuation speed^2).

    Parameters
    ----------
    motion : DrivenMotion
        Motion with loads, made by `torques`, over a whole turn.
    fluctuation : float
        Coefficient of fluctuation, such as 0.02.

    Raises
    ------
    InputError
        The fluctuation is not positive, the drive makes no whole turn, or the motion has no loads.
    """
    if not 0.0 < fluctuation < 1.0:
        raise InputError("not between 0 and 1", field="fluctuation", value=fluctuation, remedy="give a ratio, say 0.02")
    drive = motion.drive
    if drive is None or not drive.full_turn:
        raise InputError(
            "a flywheel needs a drive that makes a whole turn", field="fluctuation", value=fluctuation,
            remedy="name a drive that turns without limits, and no duration",
        )  # fmt: skip
    torque = drive_torques(motion.system, motion.solution.multipliers)[:, 0]
    if np.isnan(torque).any():
        raise InputError("the motion has no loads", field="motion", remedy="compute it by torques, with masses")
    if abs(torque[-1] - torque[0]) > _REPEATED * float(np.max(np.abs(torque))):
        raise InputError(
            "the torque does not repeat after a turn", field="fluctuation", value=fluctuation,
            remedy="leave out loads that change in time otherwise",
        )  # fmt: skip
    angle = np.linspace(drive.start, drive.end, torque.size)
    energy, mean = _energy(angle, torque)
    inertia = energy / (fluctuation * drive.speed**2)
    half = np.linspace(0, torque.size - 1, torque.size // 2 + 1).round().astype(int)
    coarse = _energy(angle[half], torque[half])[0] / (fluctuation * drive.speed**2) if half.size > 3 else 0.0
    if not abs(inertia - coarse) <= _COARSE * inertia:
        raise InputError(
            "too few samples for a flywheel", field="samples", value=torque.size, remedy="give more, say 361"
        )
    return Flywheel(inertia, fluctuation, energy, mean, abs(inertia - coarse))


def _energy(angle: np.ndarray, torque: np.ndarray) -> tuple[float, float]:
    """Return the range of the energy within a turn [J] and the mean torque [N m], from a periodic cubic spline."""
    order, closed = np.argsort(angle), np.append(torque[:-1], torque[0])
    spline = scipy.interpolate.CubicSpline(angle[order], closed[order], bc_type="periodic")
    low, high = sorted((float(angle[0]), float(angle[-1])))
    mean = float(spline.integrate(low, high)) / (high - low)
    if abs(mean) < _ROUNDING * float(np.max(np.abs(torque))):
        mean = 0.0
    stored = spline.antiderivative()
    places = np.concatenate([[low], spline.solve(mean, extrapolate=False), [high]])
    values = stored(places) - mean * places
    return float(np.ptp(values)), mean
