"""Mechanisms, paths, plans and a browser that several test files share."""

from __future__ import annotations

import os
import shutil
import signal
from dataclasses import replace

import numpy as np
import pytest

from paraflex.dynamics import build_system
from paraflex.fem import ReferenceCondition
from paraflex.mechanism import (
    Assembly,
    Curvature,
    EndEffector,
    FlexibleBeam,
    Gear,
    Geometry,
    LumpedMass,
    Material,
    Mechanism,
    Motor,
    PointRef,
    PrescribedAngle,
    RevoluteJoint,
    RigidBody,
    SampledAngle,
    Section,
    raparm_i,
)
from paraflex.paths import Polygon
from paraflex.tracking import plan_tracking

# In the background of a shell, or under nohup, processes ignore it, and so do all that they start.
if signal.getsignal(signal.SIGINT) is signal.SIG_IGN:
    signal.signal(signal.SIGINT, signal.default_int_handler)
if signal.getsignal(signal.SIGHUP) is signal.SIG_IGN:
    signal.signal(signal.SIGHUP, signal.SIG_DFL)
# The files that take longest, begun first: at the end no worker is left with one of them while the other is idle.
LONGEST = (
    "test_docs", "test_notebooks", "test_workbench_runs", "test_workbench_browser", "test_interrupts", "test_examples",
    "test_extending", "test_plot_command", "test_sweep_engines", "test_tangent", "test_loads_in_time",
    "test_report_browser", "test_gears", "test_statics",
    "test_compilation", "test_workbench_motion", "test_workbench_host", "test_workbench_moving", "test_replacing",
    "test_verification", "test_kills", "test_fuzzing",
)  # fmt: skip
# A shaper: a crank drives a block that slides along an arm.
QUICK_RETURN = """
name = "quick return"
[ground]
O = [0, 0]
Q = [0, "-150 mm"]
[body.crank]
points = { O = [0, 0], A = ["100 mm", 0] }
[body.arm]
points = { Q = [0, 0], P = ["450 mm", 0] }
[body.block]
points = { A = [0, 0] }
[joint]
O = ["ground.O", "crank.O"]
A = ["crank.A", "block.A"]
Q = ["ground.Q", "arm.Q"]
S = { points = ["arm.Q", "block.A"], type = "prismatic" }
[assembly.one]
crank = 0.3
arm = "60 deg"
block = "60 deg"
"""
SQUARE = ((0.050, 0.314), (-0.050, 0.314), (-0.050, 0.214), (0.050, 0.214))
DESKTOP, PHONE = {"width": 1440, "height": 900}, {"width": 390, "height": 844}
# Soft enough that bending, stretching and inertia are of one magnitude in a random state.
RUBBER = Material(youngs_modulus=5e6, density=1100.0)


def pytest_collection_modifyitems(items):
    """Begin with the files that take longest, see `LONGEST`; a test whose browser died runs once more."""
    place = {name: k for k, name in enumerate(LONGEST)}
    items.sort(key=lambda item: place.get(item.path.stem, len(LONGEST)))
    for item in items:
        if "browser" in item.fixturenames:
            item.add_marker(pytest.mark.flaky(reruns=1, only_rerun="TargetClosedError"))


@pytest.fixture(scope="session")
def raparm():
    """RAParM-I with the reference set."""
    return raparm_i()


@pytest.fixture(scope="session")
def square():
    """The paper's path (section 6 of the formulation)."""
    return Polygon(SQUARE, 40.0)


@pytest.fixture(scope="session")
def tracking(raparm, square):
    """The paper's study, planned; every fifth of its 701 samples."""
    return plan_tracking(raparm, square, duration=0.7, samples=141)


@pytest.fixture(scope="session", params=list(ReferenceCondition), ids=lambda c: c.value)
def condition(request):
    """Each way of fixing the floating frame to a beam."""
    return request.param


def make_linkage(condition=ReferenceCondition.CANTILEVER):
    """A linkage with one of everything, no two alike.

    Two beams with lumps, one a beam with three points, and two rigid bodies with their masses off their origins;
    the ground is side a of one joint and side b of another; one prescribed angle between two beams and one against
    the ground; motors on the ground, between bodies and with a beam on side a.
    """
    crank = FlexibleBeam(
        "crank",
        0.3,
        Section.rectangle(width=0.02, thickness=0.01),
        RUBBER,
        points={"O": 0.0, "P": 0.3},
        elements=2,
        lumps=(LumpedMass("O", 0.02, 1e-5), LumpedMass("P", 0.05, 4e-5)),
        reference=condition,
        curvature=Curvature.SHARED,
    )
    coupler = FlexibleBeam(
        "coupler",
        0.7,
        Section.rectangle(width=0.03, thickness=0.012),
        RUBBER,
        points={"P": 0.0, "Q": 0.45, "R": 0.7},
        elements=(1, 2),
        lumps=(LumpedMass("Q", 0.04, 2e-5), LumpedMass("R", 0.03, 3e-5)),
        reference=condition,
        curvature=Curvature.SHARED,
    )
    rocker = RigidBody("rocker", 0.2, 3e-3, (0.1, 0.04), {"S": (-0.02, 0.01), "Q": (0.3, -0.05)})
    flap = RigidBody("flap", 0.1, 1e-3, (-0.05, 0.02), {"R": (0.0, 0.1)})
    ramp = SampledAngle(lambda t: 0.3 + np.sin(3 * t), lambda t: 3 * np.cos(3 * t), lambda t: -9 * np.sin(3 * t))
    swing = SampledAngle(lambda t: 0.2 * t**2 - t, lambda t: 0.4 * t - 1, lambda t: 0.4 + 0 * t)
    return Mechanism(
        name="linkage",
        ground={"O": (-0.2, 0.1), "S": (0.5, -0.15)},
        bodies=(crank, coupler, rocker, flap),
        joints=(
            RevoluteJoint("O", PointRef("ground", "O"), PointRef("crank", "O")),
            RevoluteJoint("P", PointRef("crank", "P"), PointRef("coupler", "P")),
            RevoluteJoint("Q", PointRef("rocker", "Q"), PointRef("coupler", "Q")),
            RevoluteJoint("S", PointRef("rocker", "S"), PointRef("ground", "S")),
            RevoluteJoint("R", PointRef("coupler", "R"), PointRef("flap", "R")),
        ),
        motors=(Motor("base", "O"), Motor("knee", "P"), Motor("foot", "S"), Motor("hand", "R")),
        prescribed=(PrescribedAngle("wave", "R", ramp), PrescribedAngle("turn", "S", swing)),
        geometry=Geometry.LINEAR,
    )


@pytest.fixture(scope="session")
def raparm_system(raparm, condition):
    """RAParM-I as a system, under each reference condition."""
    return build_system(raparm.with_beams(reference=condition))


@pytest.fixture(scope="session")
def linkage(condition):
    """The linkage of `make_linkage` as a system, under each reference condition."""
    return build_system(make_linkage(condition))


def make_geared_linkage(condition=ReferenceCondition.CANTILEVER):
    """The linkage with gears: their rows have two ends on the crank, two on the coupler, and one each on two bodies."""
    gears = (Gear("mesh", "O", "P", -1.7, 0.3), Gear("belt", "P", "R", 0.6, -0.2), Gear("far", "O", "S", 2.3, 0.1))
    linkage = make_linkage(condition)
    # With both prescribed angles the rows would depend on one another.
    return replace(linkage, prescribed=linkage.prescribed[:1], gears=gears)


@pytest.fixture(scope="session")
def geared_linkage(condition):
    """That of `make_geared_linkage` as a system, under each reference condition."""
    return build_system(make_geared_linkage(condition))


@pytest.fixture(scope="session", params=["RAParM-I", "linkage", "geared linkage"])
def system(request, raparm_system, linkage, geared_linkage):
    """Each of the three above."""
    return {"RAParM-I": raparm_system, "linkage": linkage, "geared linkage": geared_linkage}[request.param]


def make_five_bar(base=0.1, proximal=0.25, distal=0.25):
    """The traditional 5R: two motors at the base, arms A_i B_i C, the outward assembly first (rigid bodies)."""

    def bar(name, length, points):
        return RigidBody(name, 0.2 * length, 0.01 * length**3, (length / 2, 0.0), points)

    bodies = tuple(
        bar(f"{kind}{side}", length, {a: (0.0, 0.0), b: (length, 0.0)})
        for side in "12"
        for kind, length, a, b in (("proximal", proximal, f"A{side}", f"B{side}"), ("distal", distal, f"B{side}", "C"))
    )
    joints = []
    for side in "12":
        joints += [
            RevoluteJoint(f"A{side}", PointRef("ground", f"A{side}"), PointRef(f"proximal{side}", f"A{side}")),
            RevoluteJoint(f"B{side}", PointRef(f"proximal{side}", f"B{side}"), PointRef(f"distal{side}", f"B{side}")),
        ]
    joints.append(RevoluteJoint("C", PointRef("distal1", "C"), PointRef("distal2", "C")))
    angles = {"proximal1": 2.16, "distal1": 0.25, "proximal2": 0.98, "distal2": 2.89}
    return Mechanism(
        name="5R",
        ground={"A1": (-base, 0.0), "A2": (base, 0.0)},
        bodies=bodies,
        joints=tuple(joints),
        motors=(Motor("left", "A1"), Motor("right", "A2")),
        end_effector=EndEffector(PointRef("distal1", "C")),
        assemblies=(Assembly("outward", angles),),
    )


def chromium() -> str | None:
    """Where a Chromium is."""
    names = ("chromium", "chromium-browser", "google-chrome")
    return os.environ.get("PARAFLEX_CHROMIUM") or next(filter(None, map(shutil.which, names)), None)


class LastingBrowser:
    """A Chromium that is started again where it has died: a foreign program, which did so in one suite of many."""

    def __init__(self, launch):
        self._launch, self._browser = launch, launch()

    def alive(self):
        """The browser, started again if it has died."""
        if not self._browser.is_connected():
            self._browser = self._launch()
        return self._browser

    def new_context(self, **settings):
        """A window with a memory of its own."""
        return self.alive().new_context(**settings)

    def new_page(self, **settings):
        """A page in such a window."""
        return self.alive().new_page(**settings)


@pytest.fixture(scope="module")
def browser():
    path = chromium()
    if path is None:
        message = "no Chromium: install it, or say where it is in PARAFLEX_CHROMIUM"
        if os.environ.get("CI", "").lower() in ("1", "true"):
            pytest.fail(message)
        pytest.skip(message)
    from playwright.sync_api import sync_playwright

    with sync_playwright() as playwright:
        # Root, as containers have it, may not make the sandbox; the pages are our own.
        browser = LastingBrowser(lambda: playwright.chromium.launch(executable_path=path, args=["--no-sandbox"]))
        yield browser
        browser.alive().close()


@pytest.fixture
def opened(browser, report):
    """Opens a report; what its console says and what it asks of a network must be nothing in the end."""
    complaints, contexts = [], []

    def open_page(file=report, viewport=DESKTOP, **settings):
        contexts.append(browser.new_context(viewport=viewport, **settings))
        page = contexts[-1].new_page()
        page.on("console", lambda message: complaints.append(message.text) if is_ours(message.text) else None)
        page.on("pageerror", lambda error: complaints.append(str(error)))
        page.on("request", lambda request: complaints.append(request.url) if page_asks(request.url) else None)
        page.goto(file.as_uri())
        page.wait_for_function("document.documentElement.dataset.charts === 'true'")
        return page

    yield open_page
    for context in contexts:
        context.close()
    assert complaints == []


def is_ours(message: str) -> bool:
    """Whether a message is not one of the driver that stands in for a graphics card."""
    return "GL Driver Message" not in message and "WebGL-" not in message


def page_asks(url: str) -> bool:
    """Whether a request goes anywhere but to the file and what is in it."""
    return not url.startswith(("file:", "data:", "blob:"))
