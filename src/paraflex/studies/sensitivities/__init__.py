"""Sensitivities: derivatives of what runs are judged by, by any numbers of the mechanism's file."""

from paraflex.designs.derivatives.gradient import (
    ModeGradients as ModeGradients,
    metric_gradients as metric_gradients,
    mode_gradients as mode_gradients,
)
from paraflex.designs.derivatives.plans import (
    check_differentiable_study as check_differentiable_study,
    nominal_values as nominal_values,
)
from paraflex.designs.measure import SMOOTH as SMOOTH
from paraflex.studies.sensitivities.study import (
    Sensitivities as Sensitivities,
    SensitivityStudy as SensitivityStudy,
    load_sensitivities as load_sensitivities,
    sensitivities as sensitivities,
)
