"""Free motions that make much of small errors are a finding, and others are not."""

from dataclasses import replace

import numpy as np
import pytest

import paraflex as pf
from paraflex import motion
from paraflex.errors import IntegrationError


def chain(angles, **more):
    """Uniform bars of a metre and a kilogram, one below the other."""
    bars = {f"bar{k}": angle for k, angle in enumerate(angles)}
    places = ["ground.O", *(f"{bar}.B" for bar in bars)]
    points = {"A": (0.0, 0.0), "B": (1.0, 0.0)}
    return pf.Mechanism(
        "chain",
        {"O": (0.0, 0.0)},
        tuple(pf.RigidBody(bar, 1.0, 1.0 / 12.0, (0.5, 0.0), points) for bar in bars),
        tuple(
            pf.RevoluteJoint(f"J{k}", pf.PointRef.parse(place), pf.PointRef.parse(f"{bar}.A"))
            for k, (place, bar) in enumerate(zip(places, bars, strict=False))
        ),
        assemblies=(pf.Assembly("home", bars),),
        gravity=(0.0, -9.81),
        **more,
    )


def simulate(mechanism, duration, **options):
    return pf.simulate_motion(mechanism, duration, warning=False, options=pf.IntegrationOptions(**options))


def found(run):
    return [one.text for one in run.findings if one.code == "errors-grow"]


@pytest.mark.parametrize(
    ("angles", "duration", "grows"),
    [
        ((2.0, 2.5), 40.0, True),
        ((2.0, 2.5), 4.0, False),
        ((-1.3, -1.2), 40.0, False),
        ((0.5, -0.3, 0.2), 30.0, True),
        ((0.0,), 20.0, False),
        # A pendulum that swings through 500 periods: errors of its phase add up.
        ((1.5,), 1000.0, True),
    ],
)
def test_errors_that_grow_are_found(angles, duration, grows):
    run = simulate(chain(angles), duration)
    other = simulate(chain(angles), duration, method="esdirk4")
    assert bool(np.max(np.abs(run.solution.q - other.solution.q)) > 0.05) is grows
    assert bool(found(run)) is grows


@pytest.mark.parametrize("method", ["tr-bdf2", "generalised-alpha", "radau"])
def test_they_are_found_whatever_the_method(method):
    assert found(simulate(chain((2.0, 2.5)), 15.0, method=method))
    assert not found(simulate(chain((-1.3, -1.2)), 2.0, method=method))


def test_the_finding_says_from_when_on_and_is_sought_once(monkeypatch):
    run = simulate(chain((2.0, 2.5)), 40.0)
    (text,) = found(run)
    assert "100 times the tolerance" in text
    assert 5.0 < float(text.partition("at t = ")[2].partition(" s")[0]) < 25.0
    monkeypatch.setattr(motion, "integrate", None)
    assert found(run) == [text]


def test_where_a_coarser_tolerance_does_not_do_what_it_led_to_counts(monkeypatch):
    run, integrate = simulate(chain((2.0, 2.5)), 40.0), motion.integrate

    def fails(*given, **named):
        raise IntegrationError("cannot go on", None, integrate(*given, **named), "nothing")

    monkeypatch.setattr(motion, "integrate", fails)
    assert found(run)


@pytest.mark.parametrize("tolerance", [1e-4, 1e-3, 1e-2])
def test_errors_of_loose_tolerances_grow_too(tolerance):
    # Steps hardly change with these tolerances: they are limited by how far bodies turn.
    options = {"tolerance": tolerance, "tolerance_per": "cycle"}
    run, exact = simulate(chain((2.0, 2.5)), 12.0, **options), simulate(chain((2.0, 2.5)), 12.0, tolerance=1e-9)
    assert np.max(np.abs(run.solution.q - exact.solution.q)) > 0.01
    assert found(run)


def test_a_light_body_on_a_heavy_one_is_judged_by_its_own_motion():
    # The heavy cart makes errors small in the root mean square over the mass.
    bob = pf.RigidBody("bob", 0.1, 4e-5, (0.2, 0.0), {"A": (0.0, 0.0)})
    cart = pf.RigidBody("cart", 300.0, 100.0, (0.0, 0.0), {"P": (0.0, 0.0), "L": (-1.0, 0.0)})
    points = {name: pf.PointRef.parse(name) for name in ("ground.O", "cart.P", "bob.A")}
    mechanism = pf.Mechanism(
        "cart",
        {"O": (0.0, 0.0)},
        (cart, bob),
        (
            pf.PrismaticJoint("rail", points["ground.O"], points["cart.P"]),
            pf.RevoluteJoint("pin", points["cart.P"], points["bob.A"]),
        ),
        assemblies=(pf.Assembly("home", {"cart": 0.0, "bob": -1.0}),),
        gravity=(0.0, -9.81),
    )
    start = pf.Start(angular={"bob": 20.0, "cart": 0.0}, point={points["cart.P"]: (0.0, 0.0)})
    runs = [
        pf.simulate_motion(mechanism, 20.0, start=start, warning=False, options=pf.IntegrationOptions(**options))
        for options in ({}, {"tolerance": 1e-9})
    ]
    assert np.max(np.abs(runs[0].solution.q - runs[1].solution.q)[:, -1]) > 0.005
    assert found(runs[0])
    assert not found(runs[1])
    # A bob that turns about its pin far more easily than it moves makes no singular position.
    assert not any(run.solution.singular_positions for run in runs)


def test_an_interrupted_second_run_says_so(monkeypatch):
    run, integrate = simulate(chain((-1.3, -1.2)), 2.0), motion.integrate
    monkeypatch.setattr(
        motion, "integrate", lambda *given, **named: replace(integrate(*given, **named), status="interrupted")
    )
    assert found(run) == ["interrupted before the growth of errors was checked"]


def test_motions_that_are_given_or_under_controllers_or_in_fixed_steps_are_not_tried(monkeypatch):
    drives = tuple(pf.PrescribedAngle(f"drive{k}", f"J{k}", pf.ConstantSpeed(0.0, 3.0)) for k in range(2))
    driven = simulate(chain((0.0, 0.0), prescribed=drives), 2.0)
    fixed = simulate(chain((2.0, 2.5)), 1.0, step=1e-3)
    motors = (pf.Motor("motor", "J0"),)
    simulation = pf.Simulation(chain((2.0, 2.5), motors=motors), duration=40.0)
    controlled = simulation.run(warning=False)
    monkeypatch.setattr(motion, "integrate", None)
    assert not any(found(run) for run in (driven, fixed, controlled))
