"""Models of beams that the benchmarks compare: what a model file may leave to a default is stated here."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from paraflex.fem import ReferenceCondition
from paraflex.mechanism import Curvature, Geometry, Mechanism
from paraflex.results import tracking_dataset
from paraflex.results.record import Record
from paraflex.tracking import TrackingRun, TrackingTask


@dataclass(frozen=True)
class BeamModel:
    """Geometry, reference condition and curvature of all flexible beams."""

    geometry: Geometry
    reference: ReferenceCondition
    curvature: Curvature

    @property
    def name(self) -> str:
        """In tables."""
        return f"{self.geometry.value.replace('-', ' ')}, {self.reference.value}"

    def of(self, mechanism: Mechanism) -> Mechanism:
        """The mechanism with beams of this model."""
        beams = mechanism.with_beams(reference=self.reference, curvature=self.curvature)
        return beams.with_geometry(self.geometry)

    def task(self, task: TrackingTask, refinement: int = 1) -> TrackingTask:
        """The same motion and torques for beams of this model, with so many times the elements."""
        return task.remodelled(self.of(task.mechanism).refined(refinement))


PAPER = BeamModel(Geometry.LINEAR, ReferenceCondition.CANTILEVER, Curvature.SHARED)
LINEAR_PINNED = BeamModel(Geometry.LINEAR, ReferenceCondition.PINNED, Curvature.SEPARATE)
SECOND_ORDER_CANTILEVER = BeamModel(Geometry.SECOND_ORDER, ReferenceCondition.CANTILEVER, Curvature.SEPARATE)
SECOND_ORDER = BeamModel(Geometry.SECOND_ORDER, ReferenceCondition.PINNED, Curvature.SEPARATE)


def tracking_errors(run: TrackingRun | Record, motion_end: float) -> dict[str, float]:
    """Root mean square distances of the end-effector from its desired place [m].

    Parameters
    ----------
    run : TrackingRun or Record
    motion_end : float
        Where the path's law ends [s].

    Returns
    -------
    dict
        `motion`: over the samples until there; `run`: over all, as the paper's Eq. 64.
    """
    data = tracking_dataset([run])
    deviation = (data["end_effector"] - data["end_effector_desired"]).values[0]
    squares = np.sum(deviation**2, axis=1)
    moving = data["time"].values <= motion_end
    return {"motion": float(np.sqrt(np.mean(squares[moving]))), "run": float(np.sqrt(np.mean(squares)))}
