"""`paraflex linearise` and `paraflex reduce`: linear models in the actuation modes, in full and with few states."""

import numpy as np
import xarray as xr

from paraflex.errors import InputError, renamed
from paraflex.figures import linear, reduction
from paraflex.figures.selection import names_of
from paraflex.linear import PosesAlong, poses_along
from paraflex.linear.reduced import ReductionMethod
from paraflex.results.linear_data import linear_dataset
from paraflex.results.linear_summary import about, linear_summary, remarks, roots, zeros_of
from paraflex.results.reduction_data import reduction_dataset
from paraflex.results.reduction_summary import reduction_summary
from .commands.models import LineariseRequest, ReduceRequest
from .commands.requests import flagged
from .ending import give_dataset
from .linear_models import RequestedModels, moments_along, requested_models, requested_pose
from .tables import PlainConsole, print_table

# Methods of reduction that are compared by default.
_METHODS = (ReductionMethod.CRAIG_BAMPTON.value, ReductionMethod.MODAL.value)


def linearise_command(request: LineariseRequest) -> None:
    """Linearise in every mode, print poles and zeros and, with --out, write files."""
    make = requested_models(request, "linearise")

    def data() -> xr.Dataset:
        found = make()
        with flagged(request):
            along = [] if request.along is None else moments_along(found, request.along)
            return linear_dataset(found.models, along=along, parameters=found.parameters)

    give_dataset("linear", data, linear_summary, _print_models, request.files, findings=())


def _print_models(out: PlainConsole, data: xr.Dataset) -> None:
    """Print linear models: frequencies and damping ratios, poles, zeros and remarks."""
    out.print_lines(f"{data.attrs['mechanism']}, {about(data)}: {data.sizes['state']} states")
    frequencies, *others = linear.tables(data)
    print_table(out, frequencies)
    poles = [values for _, _, values in linear.held_rows(data)]
    if all(one.on_axis for values in poles for one in roots(values)):
        zero = int(np.count_nonzero(poles[0] == 0.0))
        free = f"; {zero} at zero" + (" with motors free" if len(poles) > 1 else "") if zero else ""
        out.print(f"All poles are on the imaginary axis, 2 pi times these frequencies{free}")
    for table in others:
        print_table(out, table)
    zeros = [zeros_of(data, mode, name) for name in names_of(data, "map") for mode in names_of(data, "mode")]
    if any(one.right for values in (*poles, *zeros) for one in roots(values)):
        out.print("* in the right half plane")
    out.print_lines(*remarks(data))


def reduce_command(request: ReduceRequest) -> None:
    """Reduce the models of every mode, print the results and, with --out, write files."""
    make = requested_models(request, "reduce")

    def data() -> xr.Dataset:
        found = make()
        requested = {name: getattr(request, name) for name in ("states", "methods", "until", "error")}
        requested |= {} if request.basis is None else {"basis": request.basis}
        parameters = {**found.parameters, "run": found.parameters["run"] | requested}
        with flagged(request):
            return reduction_dataset(
                found.models, request.states, methods=request.methods or _METHODS, until=request.until,
                error=request.error, along=_along(found, request), parameters=parameters,
            )  # fmt: skip

    give_dataset("reduction", data, reduction_summary, _print_reduction, request.files, findings=())


def _along(found: RequestedModels, request: ReduceRequest) -> list[PosesAlong]:
    """Return the poses along the path for each mode, with the pose whose basis is used; empty without --along."""
    if request.along is None:
        if request.basis is not None:
            raise InputError("is the pose whose basis is taken along a path", field="--basis", value=request.basis,
                             remedy="give the number of poses: --along 21")  # fmt: skip
        return []
    pose = None if request.basis is None else requested_pose(found.model, request.basis, request.assembly, "--basis")
    with renamed("--along", only="count"):
        return [poses_along(motion, request.along, mode=mode, pose=pose, **found.ports)
                for motion, mode in zip(found.motions, found.modes, strict=True)]  # fmt: skip


def _print_reduction(out: PlainConsole, data: xr.Dataset) -> None:
    """Print reduced models: states needed, errors, frequencies, errors along the path, and error bounds."""
    attrs = data.attrs
    out.print_lines(
        f"{attrs['mechanism']}, about {attrs['about']}: {attrs['kept_states']} of {attrs['full_states']} states"
    )
    for table in reduction.tables(data):
        print_table(out, table)
    out.print_lines(*reduction.bound_sentences(data))
