"""Reachability and observability of a sampled plant: motions that motors do not reach or readings do not show."""

import numpy as np
import scipy

from paraflex.arrays import Array
from paraflex.errors import InputError
from .sampled import SampledPlant

# Poles further inside the unit circle than this decay without control.
_ON_CIRCLE = 1e-9
# Least singular value of the balanced [A - z, B] below which a motion is not reached.
_UNCONTROLLABLE = 1e-11
_NAMED = 4


def check_controllable(
    plant: SampledPlant, columns: Array, field: str, problem: str, remedy: str, *, transposed: bool = False
) -> None:
    """Check that given columns reach all motions that do not decay (Hautus test).

    Parameters
    ----------
    plant : SampledPlant
        Sampled plant.
    columns : (n, m) array
        Input columns; or output rows as columns, with `transposed`.
    field, problem, remedy : str
        Parts of the error.
    transposed : bool
        Whether observability by outputs is tested in place of reachability.

    Raises
    ------
    InputError
        Motions that are not reached, named by their frequencies.
    """
    n = plant.own
    size = np.asarray(scipy.linalg.matrix_balance(plant.A[:n, :n], permute=False, separate=True)[1][0])
    A = plant.A.copy()
    A[:n] /= size[:, None]
    A[:, :n] *= size
    A = A.T if transposed else A
    columns = columns * np.concatenate([size if transposed else 1.0 / size, np.ones(len(A) - n)])[:, None]
    columns = columns / max(float(np.linalg.norm(columns)), np.finfo(float).tiny)
    missed = []
    for z in plant.poles:
        if abs(z) < 1.0 - _ON_CIRCLE or z.imag < 0.0:
            continue
        least = np.linalg.svd(np.hstack([A - z * np.eye(len(A)), columns]), compute_uv=False)[-1]
        if least < _UNCONTROLLABLE:
            missed.append(frequency_of(complex(z), plant.period))
    if missed:
        names = sorted({"free motion (0 Hz)" if hertz < 1e-4 / plant.period else f"{hertz:.4g} Hz" for hertz in missed})
        more = f" and {len(names) - _NAMED} more" if len(names) > _NAMED else ""
        raise InputError(problem, field=field, value=", ".join(names[:_NAMED]) + more, remedy=remedy)


def frequency_of(z: complex, period: float) -> float:
    """Return the frequency of a sampled pole [Hz], |angle| / (2 pi T)."""
    return float(abs(np.angle(z))) / (2.0 * np.pi * period)
