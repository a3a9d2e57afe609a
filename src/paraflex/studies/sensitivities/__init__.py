"""Sensitivities: derivatives of what runs are judged by, by any numbers of the mechanism's file."""

from paraflex.designs.derivatives.gradient import ModeGradients, metric_gradients, mode_gradients
from paraflex.designs.derivatives.plans import check_differentiable_study, nominal_values
from paraflex.designs.measure import SMOOTH
from paraflex.studies.sensitivities.study import (
    Sensitivities,
    SensitivityStudy,
    load_sensitivities,
    sensitivities,
)

__all__ = [
    "SMOOTH",
    "ModeGradients",
    "Sensitivities",
    "SensitivityStudy",
    "check_differentiable_study",
    "load_sensitivities",
    "metric_gradients",
    "mode_gradients",
    "nominal_values",
    "sensitivities",
]
