"""Messages that take a damaged installation, odd numbers or rare motions to see: each names what, where, the remedy."""

from __future__ import annotations

import sys
import warnings
from dataclasses import replace
from functools import partial

import numpy as np
import pytest

import paraflex as pf
from paraflex.actuation import feed_forward
from paraflex.campaign import Workers
from paraflex.checks import check_planned
from paraflex.designs.derivatives import changes, gradient
from paraflex.designs.run import Task, run_task
from paraflex.dynamics import State, build_system
from paraflex.errors import InputError, IntegrationError, NumericalError
from paraflex.figures.designs import DesignTable
from paraflex.files.library import library_text
from paraflex.integrators import sensitivity
from paraflex.mechanism import Material, ModalBody, ModalPoint, PointRef, RigidBody, SlidingJoint, parse_mode
from paraflex.motion import simulate_motion
from paraflex.plots import pareto_front
from paraflex.reports.page import plotly_script
from paraflex.studies import load_sensitivities, load_sweep, motion_case, sensitivities, sweep
from paraflex.tracking import simulate

SWEEP = """
mechanism = "five_bar"
paths = ["square"]
modes = ["++"]
duration = 0.02
samples = 3

[vary.arm]
fields = ["material.aluminium.youngs_modulus"]
values = [2.0e11, 2.1e11]
"""


FRICTION = '[friction.bush]\njoint = "pivot"\nlimit = 0.2\nspeed = 0.01\n'
PENDULUM = library_text("pendulum")


def designs(metrics):
    number, text = np.arange(2), np.array(["", ""])
    status = np.array(["complete", "complete"])
    return DesignTable({"arm": np.array([1.0, 2.0])}, metrics, {}, number, number, text, text, status, text)


@pytest.fixture
def study(tmp_path):
    file = tmp_path / "study.toml"
    file.write_text(SWEEP, encoding="utf-8")
    return load_sweep(file)


def refused(call, field, problem, remedy):
    with pytest.raises(InputError) as caught:
        call()
    error = caught.value
    assert error.field == field
    assert problem in error.problem
    assert remedy in error.remedy


def test_torques_that_no_spline_follows(monkeypatch):
    model = pf.load("five_bar")
    task = pf.plan(model.mechanism, model.path("square"), duration=0.02, samples=5)
    # No accuracy is fine enough for these, as where torques have a pole.
    monkeypatch.setattr(feed_forward, "_SPLINE_ERROR", 0.0)
    with pytest.raises(
        NumericalError, match=r'the torques of mode "\+\+" rise too steeply to be interpolated'
    ) as caught:
        task.torques("++")
    assert caught.value.remedy


def test_a_mass_matrix_that_is_not_positive_definite():
    """Nothing is left of the beam in floating point."""
    pendulum = pf.load("pendulum").mechanism
    heavy = replace(pendulum.bodies[0], material=Material(210e9, 1e-30))
    refused(
        lambda: build_system(pendulum.with_bodies([heavy])),
        "body.beam", "its mass matrix is not positive definite", "many orders of magnitude apart",
    )  # fmt: skip


@pytest.fixture
def differentiated(tmp_path):
    file = tmp_path / "sensitivity.toml"
    file.write_text(SWEEP.replace("values = [2.0e11, 2.1e11]\n", ""), encoding="utf-8")
    return load_sensitivities(file)


def test_derivatives_where_there_are_none(differentiated, monkeypatch):
    monkeypatch.setattr(sensitivity, "_LARGEST_RESIDUAL", -1.0)
    with pytest.raises(IntegrationError, match="the equations of a step cannot be solved to rounding") as caught:
        sensitivities(differentiated)
    assert caught.value.remedy == "choose a finer tolerance, or take derivatives by differences"


def test_packages_that_are_missing(study, tmp_path, monkeypatch):
    monkeypatch.setitem(sys.modules, "distributed", None)
    refused(
        lambda: sweep(study, tmp_path / "out", workers=Workers("dask")),
        "--engine", "Dask is not installed", "pip install 'paraflex[cluster]'",
    )  # fmt: skip
    for module in ("sksundae", "sksundae.cvode", "sksundae.ida"):
        monkeypatch.setitem(sys.modules, module, None)
    model = pf.load("five_bar")
    task = pf.plan(model.mechanism, model.path("square"), duration=0.02, samples=3)
    refused(lambda: task.simulate("++", method="ida"), "method", "SUNDIALS", "pip install")
    monkeypatch.setattr("paraflex.reports.page.find_spec", lambda _: None)
    # Once read it is kept.
    whole = partial(plotly_script.__wrapped__, whole=True)
    refused(whole, "plotly", "not installed, or without its script", "--force-reinstall plotly")


def test_workers_with_another_installation(study):
    setting = replace(study.setting, versions=dict(study.setting.versions) | {"numpy": "1.0"})
    task = Task(0, 0, (2.0e11,), "square")
    began = "the sweep was begun with 1.0"
    refused(lambda: run_task(setting, task), "--cluster", began, "give workers the same installation")


def test_designs_of_one_metric():
    given = {"work": np.array([1.0, 1.0]), "tracking_rms": np.array([1.0, 2.0])}
    table = designs(given)
    refused(lambda: table.judged_by(["worth"], 2), "metric", "not a metric of these results", "did you mean")
    refused(
        lambda: pareto_front(table, ["tracking_rms"]), "metric", "a Pareto front is of two metrics", "two that vary"
    )
    refused(
        lambda: designs(given | {"tracking_rms": given["work"]}).judged_by(None, 2),
        "metric",
        "no metric varies",
        "more designs",
    )


def test_motions_of_no_length():
    mechanism = pf.load("pendulum").mechanism
    system = build_system(mechanism)
    start = State(0.0, np.zeros(system.n), np.zeros(system.n))
    short = (partial(motion_case, mechanism, 0.0, start=start), "duration", "must be positive", "give it in seconds")
    refused(*short)
    few = (partial(motion_case, mechanism, 1.0, samples=1, start=start), "samples", "too few samples", "at least 2")
    refused(*few)
    model = pf.load("five_bar")
    refused(
        lambda: pf.plan(model.mechanism, model.path("square"), samples=1),
        "samples", "too few samples", "at least 2",
    )  # fmt: skip


def test_a_table_of_too_many_rows(tmp_path):
    (tmp_path / "law.csv").write_text("0.0, 1.0\n" * 600_000, encoding="utf-8")
    file = tmp_path / "driven.toml"
    file.write_text(PENDULUM + '[prescribed.drive]\njoint = "pivot"\ntable = "law.csv"\n', encoding="utf-8")
    remedy = "save two columns as CSV, of at most 5 MB"
    refused(lambda: pf.load(file), "prescribed.drive.table", "too large a file", remedy)


@pytest.mark.parametrize(
    ("added", "code", "place", "text"),
    [
        ("[start.velocity.angular]\nbeam = 6000.0\n", "speed-large", "start.velocity.angular.beam", "6000 rad/s, in"),
        (
            '[prescribed.drive]\njoint = "pivot"\nangle = 90.0\n',
            "angle", "prescribed.drive", "it starts at 90 rad, more than a turn",
        ),
        (
            '[prescribed.drive]\njoint = "pivot"\nangle = "90*sin(t)"\n',
            "angle", "prescribed.drive", "it swings over",
        ),
        ("[ground]\nFAR = [600.0, 0.0]\n", "size", "ground", "ground points 600 m apart, and bodies of 0.6 m"),
        (
            '[motor]\ntau = "pivot"\n[study.torques]\ntau = 4500.0\n',
            "load-large", "study.torques.tau", "4.5e+03 N m, where all bodies weigh",
        ),
        (
            '[motor]\ntau = "pivot"\n[study.torques]\ntau = 0.1\n' + FRICTION,
            "friction-large", "friction.bush.limit", "0.2 N m, where motor tau gives 0.1 N m: it does not move",
        ),
    ],
)  # fmt: skip
def test_slips_of_a_pendulum(tmp_path, added, code, place, text):
    file = tmp_path / "pendulum.toml"
    table = "[ground]\n"
    file.write_text(
        PENDULUM.replace(table, added) if added.startswith(table) else f"{PENDULUM}\n{added}", encoding="utf-8"
    )
    with warnings.catch_warnings():
        warnings.simplefilter("ignore", pf.ModelWarning)
        verdict = pf.check(file)
    assert text in [one.text[: len(text)] for one in verdict if (one.code, one.place) == (code, place)]


def test_a_sliding_joint_on_a_rigid_body():
    mechanism = pf.load("pendulum").mechanism.rigid()
    rigid = RigidBody("bar", 1.0, 1.0, points={"A": (0.0, 0.0)})
    slide = SlidingJoint("slide", PointRef("bar", "A"), PointRef("beam", "tip"))
    with pytest.raises(InputError, match=r"joint\.slide: a sliding joint needs a beam to slide on") as caught:
        replace(mechanism, bodies=(*mechanism.bodies, rigid), joints=(*mechanism.joints, slide))
    assert 'use a "slot"' in caught.value.remedy


def test_samples_without_numbers(tmp_path):
    text = SWEEP.replace("values = [2.0e11, 2.1e11]", "low = 2.0e11\nhigh = 2.1e11")
    for replaced, field, problem, remedy in (
        ('[sampling]\nkind = "random"\n', "sampling.number", "is missing", "give the number of designs"),
        (
            '[sampling]\nkind = "random"\nnumber = 0\n',
            "sampling.number",
            "must be positive",
            "give the number of designs",
        ),
        ('[sampling]\nkind = "list"\n', "vary.arm.values", "is missing", "give a list of numbers, one per design"),
    ):
        file = tmp_path / "study.toml"
        file.write_text(f"{text}\n{replaced}", encoding="utf-8")
        refused(partial(load_sweep, file), field, problem, remedy)
    file.write_text(SWEEP.replace("duration = 0.02", "duration = 0.0"), encoding="utf-8")
    refused(partial(load_sweep, file), "duration", "must be positive", "give it in s")


def test_derivatives_that_designs_or_runs_do_not_have(differentiated, monkeypatch):
    layout = "the number of pieces or elements changes with it: no derivative"
    nearby = "choose a slightly different value with --at"
    with monkeypatch.context() as patch:
        # As where a number of elements follows from a length.
        patch.setattr(changes, "same_layout", lambda *_: False)
        refused(lambda: sensitivities(differentiated), "vary.arm", layout, nearby)

    def never(*_):
        raise InputError("not a modulus", field="material", value=0.0, remedy="give it in Pa")

    with monkeypatch.context() as patch:
        patch.setattr(changes, "_moved", never)
        problem = "has no derivative: a nearby value fails, material: not a modulus"
        refused(lambda: sensitivities(differentiated), "vary.arm", problem, "leave it out")

    def passing(*arguments, **options):
        run = simulate(*arguments, **options)
        return replace(run, solution=replace(run.solution, singular_positions=(0.01,)))

    with monkeypatch.context() as patch:
        patch.setattr(gradient, "simulate", passing)
        with pytest.raises(NumericalError, match=r"the run passes a singular position, .* at t = 0\.01 s") as caught:
            sensitivities(differentiated)
        assert caught.value.remedy.startswith("shorten the run")


def test_deflections_of_bodies_that_have_none():
    """Three points of a bar of given shapes tell how it bends, two do not."""
    pendulum = pf.load("pendulum").mechanism
    s = build_system(pendulum).bodies[0].integrals
    points = {name: ModalPoint((x, 0.0), np.zeros((2, s.nf)), np.zeros(s.nf)) for name, x in (("O", 0.0), ("tip", 0.6))}
    body = ModalBody(
        "beam", mass=s.m, first_moment=s.S1, inertia=s.I0 + s.J, mass_matrix=s.Mff, stiffness=s.K, S2=s.S2,
        I1=s.I1, G1=s.G1 + s.Jf, G2=s.G2, I2=s.I2, points=points,
    )  # fmt: skip
    options = pf.IntegrationOptions(events=(pf.DeflectionLimit("beam", 0.01),))
    two = "a deflection is from the line between first and last point, which takes three points"
    refused(
        lambda: simulate_motion(pendulum.with_bodies([body]), 0.1, options=options, samples=3),
        "events", two, "give the body a point between",
    )  # fmt: skip


def test_a_path_near_a_singular_position_is_doubted():
    """As where the distal links are almost in line: one motor's torque hardly acts on the end-effector."""
    model = pf.load("five_bar")
    path = model.path("square")
    task = pf.plan(model.mechanism, path, duration=0.02, samples=3)
    weak = task.effort.matrix * np.array([1.0, 1e-5])
    doubtful = replace(task, effort=replace(task.effort, matrix=weak))
    modes = [parse_mode(model.mechanism, "++")]
    for given, codes in ((task, []), (doubtful, ["path-ill-conditioned"])):
        found = check_planned(model, given, "square", modes, None)
        assert [one.code for one in found] == codes
    assert found[0].place == "mode.++"
    assert "near a singular position" in found[0].text
