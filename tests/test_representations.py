"""Representations of objects, as the prompt and failing tests show them: a few lines, with names and shapes."""

from __future__ import annotations

import warnings
from collections.abc import Iterator, Mapping
from dataclasses import dataclass, field, fields, is_dataclass, replace
from pathlib import Path
from tempfile import mkdtemp
from typing import Any

import numpy as np
import pytest

import paraflex as pf
from paraflex.arrays import Brief, whole
from paraflex.reports import tracking_page

# Modules of objects that no public function returns, which only hold parts of those that they do.
INTERNAL = ("dynamics.tangents", "equilibria.branch", "equilibria.equations", "linear.coordinates", "kernel.")
# Characters and lines that fit into a terminal and into the message of a failing test.
LONGEST, LINES = 800, 12


def runs() -> Iterator[Any]:
    model = pf.load("raparm_i")
    task = model.plan(samples=51)
    run = pf.simulate(task, "++++")
    yield from (model, task, run, run.end_effector, run.validity, run.findings, task.in_segments(4))
    yield from (pf.shape_torques(task, pf.shaper("zvd", [51.4], damping=0.01)), pf.check(model.mechanism))
    data = pf.tracking_dataset([run])
    yield from (pf.compare(data, data), tracking_page(data), pf.run_study(task, ["++++"]))
    motion = pf.simulate_motion(pf.load("slider_crank_flexible"), 0.02, samples=51)
    yield from (motion, motion.electrical, motion.validity, motion.findings)
    for name in pf.library.names():
        yield pf.load(name)


def linear_models() -> Iterator[Any]:
    model = pf.load("raparm_i")
    task = model.plan(samples=51)
    linear = pf.linearise(model.mechanism, mode="++++")
    reduced = pf.reduce(linear, 16)
    varying = pf.linearise_along(task, mode="++++")
    yield from (linear, reduced, linear.motions(()), varying, varying.discretised(1e-3))
    yield from (pf.poses_along(task, 3, mode="++++"), pf.planned_reduction(task, 1e-4), pf.discretise(reduced, 1e-3))
    yield pf.statics(pf.load("folded_beam_guide"), steps=2)


def controlled() -> Iterator[Any]:
    task = pf.load("raparm_i").plan(samples=51)
    simulation = pf.Simulation(task, mode="++++")
    gains = pf.joint_gains(task, "++++", 8.0)
    controller = pf.SampledController(pf.JointPID(gains.stiffness, gains.damping), period=1e-3)
    yield from (simulation, simulation.save(), gains, controller, simulation.run(controller, until=0.01))


STUDY = {
    "mechanism": "raparm_i", "paths": ["square"], "modes": ["++++"], "duration": 0.02, "samples": 11,
    "vary": {"bar.thickness": {"low": 0.004, "high": 0.006}},
}  # fmt: skip


def studies() -> Iterator[Any]:
    varied = STUDY | {"vary": {"bar.thickness": {"values": [0.005]}}}
    yield from (pf.load_sweep(varied), pf.load_indices(STUDY), pf.load_sensitivities(varied))
    yield pf.load_optimisation(STUDY | {"objective": {"minimise": {"tracking_rms": 1.0}}})
    yield pf.load_identification(STUDY | {"target": [{"metric": "tracking_rms", "value": 1e-3}]})
    folder = Path(mkdtemp())
    yield from (pf.sweep(varied, folder / "a"), pf.sensitivities(varied | {"metrics": ["tracking_rms"]}))
    search = {"objective": {"minimise": {"tracking_rms": 1.0}}, "search": {"evaluations": 3}}
    yield pf.optimise(STUDY | search, folder / "b")
    task = pf.load("raparm_i").plan(samples=11, duration=0.02)
    yield from (pf.verify(task, ["++++"], models=["linear", "second-order"]), pf.run_study(task, ["++++"]))


def designed() -> Iterator[Any]:
    mechanism = pf.load("raparm_i").mechanism
    links = [replace(link, damping=pf.ModalDamping((0.01,))) for link in mechanism.bodies]
    gauges = [pf.StrainGauge(f"root{k}", body=f"link{k}", at=0.05) for k in (1, 2, 5, 6)]
    model = pf.reduce(pf.linearise(replace(mechanism, bodies=links, sensors=gauges), mode="++++"), 8)
    angles = ["A1", "D1", "A2", "D2"]
    design = pf.lqg(
        model, 1e-3, measured=angles, effort=1.0, noise=1e-4, disturbance=0.3,
        deviations={"x": 0.2e-3, "y": 0.2e-3, **dict.fromkeys(angles, 0.03)},
    )  # fmt: skip
    yield from (model, design, design.law(), pf.closed_loop(model, design), pf.margins(model, design))
    yield pf.rate_feedback_gains(model, 1e-3, delay=1e-3)


def parts(thing: Any, path: str, seen: dict[int, Any]) -> Iterator[tuple[str, Any]]:
    """Yield an object of the package and all that its public fields hold, with their places."""
    if id(thing) in seen:
        return
    seen[id(thing)] = thing
    members: list[tuple[str, Any]] = []
    if isinstance(thing, Mapping):
        members = [(f"{path}[{name!r}]", each) for name, each in list(thing.items())[:4]]
    elif isinstance(thing, tuple | list):
        members = [(f"{path}[{k}]", each) for k, each in enumerate(thing[:4])]
    names = [each.name for each in fields(thing)] if is_dataclass(thing) else getattr(thing, "_fields", ())
    members += [(f"{path}.{name}", getattr(thing, name)) for name in names if not name.startswith("_")]
    home, name = type(thing).__module__, type(thing).__name__
    if home.startswith("paraflex.") and not home.removeprefix("paraflex.").startswith(INTERNAL) and name[0] != "_":
        yield path, thing
    for place, each in members:
        yield from parts(each, place, seen)


@pytest.mark.parametrize("make", [runs, linear_models, controlled, designed, studies])
def test_representations_are_short(make):
    seen: dict[int, Any] = {}
    with warnings.catch_warnings():
        warnings.simplefilter("ignore")
        found = [part for thing in make() for part in parts(thing, type(thing).__name__, seen)]
    assert len(found) > 50
    long = {type(thing).__qualname__: (len(repr(thing)), place) for place, thing in found
            if len(repr(thing)) >= LONGEST or repr(thing).count("\n") >= LINES}  # fmt: skip
    assert not long, dict(sorted(long.items()))


@dataclass(frozen=True)
class Sampled(Brief):
    name: str
    values: np.ndarray
    gains: tuple[float, ...] = (0.1, 0.2)
    inner: Any = None
    texts: tuple[str, ...] = ()
    hidden: int = field(default=0, repr=False)


def test_arrays_are_given_by_their_shapes_and_long_values_by_their_classes():
    small = Sampled("a", np.arange(3.0))
    assert repr(small) == "Sampled(name='a', values=array([0., 1., 2.]), gains=(0.1, 0.2), inner=None, texts=())"
    large = Sampled("b", np.zeros((701, 30)), inner=small)
    assert repr(large) == (
        "Sampled(name='b', values=array(701, 30), gains=(0.1, 0.2), inner=Sampled(name='a', "
        "values=array([0., 1., 2.]), gains=(0.1, 0.2), inner=None, texts=()), texts=())"
    )
    long = Sampled("c", np.zeros(9), inner=large, texts=("a name",) * 90)
    assert repr(long) == "Sampled(name='c', values=array(9), gains=(0.1, 0.2), inner=Sampled('b'), texts=<90 str>)"


def test_descriptions_that_differ_in_what_is_abbreviated_have_different_whole_representations():
    first, second = (
        Sampled("a", np.zeros(1), inner={"b": Sampled("c", np.zeros(1), texts=("x" * 600, end))}) for end in "yz"
    )
    assert repr(first) == repr(second)
    assert whole(first) != whole(second)
    assert whole(first) == whole(
        Sampled("a", np.zeros(1), inner={"b": Sampled("c", np.zeros(1), texts=("x" * 600, "y"))})
    )


def test_small_descriptions_are_represented_as_they_are_written():
    joint = pf.RevoluteJoint("pin", pf.PointRef("ground", "O"), pf.PointRef("bar", "A"))
    assert "name='pin'" in repr(joint)
    assert "a=PointRef(" in repr(joint)
    steel = pf.Material(youngs_modulus=210e9, density=7850.0)
    assert eval(repr(steel), {"Material": pf.Material}) == steel


def test_an_object_that_holds_itself_is_represented():
    held: list[Any] = []
    around = Sampled("a", np.zeros(1), inner=held)
    held.append(around)
    assert repr(around).count("Sampled") == 2
    assert "inner=...," in repr(around)
