"""Runs of a mechanism."""

from __future__ import annotations

from typing import Annotated

import typer

from paraflex.cli.commands.options import (
    DEFAULT_MODEL,
    AssemblyOption,
    CurvatureOption,
    DurationOption,
    Json,
    MechanismOption,
    MethodOption,
    ModelArgument,
    PathOption,
    ReferenceOption,
    ReportOption,
    SamplesOption,
    model_named,
)


def run(
    source: ModelArgument = None,
    mechanism: MechanismOption = None,
    path: PathOption = None,
    mode: Annotated[
        list[str] | None,
        typer.Option(
            metavar="MODE",
            help="Actuation mode: signs (+-+-) or motor names (tau1,tau5); repeatable. Default: the study's.",
        ),
    ] = None,
    tol: Annotated[float | None, typer.Option(metavar="METRES", help="Tolerance; the study's, else 1e-5.")] = None,
    duration: DurationOption = None,
    samples: SamplesOption = None,
    assembly: AssemblyOption = None,
    alpha: Annotated[float | None, typer.Option(metavar="1/S", help="Baumgarte coefficient alpha.")] = None,
    beta: Annotated[float | None, typer.Option(metavar="1/S", help="Baumgarte coefficient beta.")] = None,
    max_steps: Annotated[
        int | None, typer.Option(metavar="N", help="Steps before a run is given up. Default: ten million.")
    ] = None,
    method: MethodOption = None,
    method_parameter: Annotated[
        list[str] | None, typer.Option(metavar="NAME=VALUE", help="A parameter of the method; repeatable.")
    ] = None,
    step: Annotated[
        float | None, typer.Option(metavar="S", help="A fixed step. Default: steps are chosen by their errors.")
    ] = None,
    constraints: Annotated[
        str | None,
        typer.Option(metavar="baumgarte|projection|ggl", help="What keeps the constraints. Default: the method's."),
    ] = None,
    automatic_gains: Annotated[
        bool, typer.Option("--automatic-gains", help="Baumgarte coefficients that follow the step.")
    ] = False,
    stop_at: Annotated[
        list[str] | None,
        typer.Option(
            metavar="EVENT",
            help="Where the run ends: joint:NAME=LOW..HIGH, deflection:BODY=METRES, singular=DISTANCE, "
            "singular:MOTOR,...=DISTANCE; repeatable.",
        ),
    ] = None,
    rigid: Annotated[bool, typer.Option("--rigid", help="Take all bodies as rigid.")] = False,
    geometry: Annotated[
        str | None, typer.Option(metavar="second-order|linear", help="Shape of the beams. Default: the model's.")
    ] = None,
    reference: ReferenceOption = None,
    curvature: CurvatureOption = None,
    segments: Annotated[
        int | None,
        typer.Option(metavar="N", help="Cut beams into finite segments, so many the longest (the paper's: 8)."),
    ] = None,
    ked: Annotated[
        bool, typer.Option("--ked", help="Kineto-elastodynamics: active motors held on the rigid motion.")
    ] = False,
    balanced: Annotated[
        bool,
        typer.Option(
            "--balanced", help="Start balanced, active motors held, or moving as drives prescribe; else undeformed."
        ),
    ] = False,
    after: Annotated[
        str | None,
        typer.Option(metavar="free|hold", help="The active motors after the path: hold is by brakes. Default: free."),
    ] = None,
    out: Annotated[str, typer.Option(metavar="DIR", help="Folder for results and figures.")] = "results",
    report: ReportOption = True,
    json: Json = False,
) -> None:
    """Simulate a path in several actuation modes, or a model without a path on its own.

    Writes report.html, summary.json, results.nc and figures/.
    """
    from paraflex.cli.integration import IntegrationRequest
    from paraflex.cli.run import RunRequest, run_command

    integration = IntegrationRequest(
        tolerance=tol,
        alpha=alpha,
        beta=beta,
        max_steps=max_steps,
        method=method,
        parameters=method_parameter or [],
        step=step,
        constraints=constraints,
        automatic_gains=automatic_gains,
        stop_at=stop_at or [],
    )
    request = RunRequest(
        mechanism=model_named(source, mechanism) or DEFAULT_MODEL,
        path=path,
        modes=mode or [],
        duration=duration,
        samples=samples,
        assembly=assembly,
        out=out,
        json=json,
        integration=integration,
        rigid=rigid,
        geometry=geometry,
        reference=reference,
        curvature=curvature,
        segments=segments,
        ked=ked,
        balanced=balanced,
        after=after,
        report=report,
    )
    raise typer.Exit(run_command(request))


def verify(
    source: ModelArgument = None,
    mechanism: MechanismOption = None,
    path: PathOption = None,
    mode: Annotated[
        list[str] | None,
        typer.Option(metavar="MODE", help="Actuation mode; repeatable. Default: the study's with most motors."),
    ] = None,
    engine: Annotated[
        list[str] | None, typer.Option(metavar="exudyn|mujoco", help="Another engine to compare with; repeatable.")
    ] = None,
    model: Annotated[
        list[str] | None,
        typer.Option(
            metavar="NAME",
            help="Fidelity: rigid, ked, linear, second-order, segments; repeatable. Default: all of them.",
        ),
    ] = None,
    tol: Annotated[float | None, typer.Option(metavar="METRES", help="Tolerance of runs with error control.")] = None,
    method: MethodOption = None,
    segments: Annotated[int | None, typer.Option(metavar="N", help="Finite segments on the longest beam.")] = None,
    reference: ReferenceOption = None,
    curvature: CurvatureOption = None,
    duration: DurationOption = None,
    samples: SamplesOption = None,
    assembly: AssemblyOption = None,
    out: Annotated[str, typer.Option(metavar="DIR", help="Folder for numbers and figures.")] = "verification",
    report: ReportOption = True,
    json: Json = False,
) -> None:
    """Run a mechanism at every fidelity and in other engines.

    Writes report.html, verify.json, verify.nc and figures/.
    """
    from paraflex.cli.verify import VerifyRequest, verify_command

    request = VerifyRequest(
        mechanism=model_named(source, mechanism) or DEFAULT_MODEL,
        path=path,
        modes=mode or [],
        tolerance=tol,
        duration=duration,
        samples=samples,
        assembly=assembly,
        out=out,
        json=json,
        engines=engine or [],
        fidelities=model or [],
        segments=segments,
        method=method,
        reference=reference,
        curvature=curvature,
        report=report,
    )
    raise typer.Exit(verify_command(request))


def compare_methods(
    source: ModelArgument = None,
    mechanism: MechanismOption = None,
    path: PathOption = None,
    mode: Annotated[
        str | None, typer.Option(metavar="MODE", help="Actuation mode. Default: the study's with most motors.")
    ] = None,
    method: Annotated[
        list[str] | None, typer.Option(metavar="NAME", help="Method of integration; repeatable. Default: all of them.")
    ] = None,
    tol: Annotated[
        list[float] | None,
        typer.Option(metavar="METRES", help="Tolerance; repeatable. Default: 1e-3, 1e-4, 1e-5, 1e-6."),
    ] = None,
    step: Annotated[
        list[float] | None,
        typer.Option(metavar="S", help="Fixed step; repeatable. Without --tol fixed steps are all there is."),
    ] = None,
    limit: Annotated[float | None, typer.Option(metavar="S", help="Wall time of a run. Default: 60.")] = None,
    duration: DurationOption = None,
    samples: SamplesOption = None,
    assembly: AssemblyOption = None,
    out: Annotated[str, typer.Option(metavar="DIR", help="Folder for numbers and figure.")] = "comparison",
    json: Json = False,
) -> None:
    """Time every method of integration against its error; write compare-methods.json and figures/."""
    from paraflex.cli.compare import CompareRequest, compare_command

    request = CompareRequest(
        mechanism=model_named(source, mechanism) or DEFAULT_MODEL,
        path=path,
        modes=[] if mode is None else [mode],
        duration=duration,
        samples=samples,
        assembly=assembly,
        out=out,
        json=json,
        methods=method or [],
        tolerances=tol or [],
        steps=step or [],
        limit=limit,
    )
    raise typer.Exit(compare_command(request))
