"""RAParM-I under a digital controller: learned torques, LQG with quantised encoders and gauges, an unknown payload.

The rigid plan's torques leave the flexible mechanism 0.6 mm off its square. Learning on the simulation takes that away:
the change of torques that a linear model along the motion finds best for the error of the last run, from run to run.
What learning does not know, here a payload 20 % too heavy, is left to feedback: an LQG controller at 1 kHz that reads
encoders and strain gauges, and whose torques act one sample late, within 20 N m. It estimates a slowly varying force
at the payload. Its model has 44 states: all vibrations up to 1042 Hz, which sampling folds back. With undamped links it
needs those up to 2.5 kHz as well, 100 states, and then still does not hold one beyond 1 kHz. Readings are exact, then
quantised: that adds noise, of which every processor gives another sample, as rounding decides between two steps of a
reading.
"""

from __future__ import annotations

from dataclasses import replace
from typing import NamedTuple

import numpy as np
import scipy

import paraflex as pf

MODE, PERIOD, PAYLOAD = "++++", 1e-3, 0.1
MOTORS, TIP = ["tau1", "tau2", "tau5", "tau6"], "link4.C"
ENCODERS, GAUGES = ["A1", "D1", "A2", "D2"], ["root1", "root3", "root5", "root7"]
RESOLUTION = {**dict.fromkeys(ENCODERS, 2 * np.pi / 40000), **dict.fromkeys(GAUGES, 1e-6)}


# Damping of the links, states of the design's model; steps of the simulation go from sample to sample.
DAMPING, STATES, STATES_UNDAMPED = 0.01, 44, 100
OPTIONS = pf.IntegrationOptions(method="esdirk5", step=PERIOD)


def manipulator(payload: float, damping: float = DAMPING) -> pf.Mechanism:
    """RAParM-I in second-order geometry, all links damped, gauges on the driven ones, with a payload [kg]."""
    robot = pf.library.raparm_i().with_geometry("second-order")
    gauges = tuple(pf.StrainGauge(f"root{k}", f"link{k}", at=0.02) for k in (1, 3, 5, 7))
    if damping:
        robot = robot.with_bodies([replace(link, damping=pf.ModalDamping((damping,))) for link in robot.bodies])
    return replace(robot, sensors=gauges).with_payload(pf.Payload(payload))


class Learned(pf.SampledController):
    """Torques (k, motors) from a table, one row a sample; the readings (k, sensors) are kept."""

    def __init__(self, torques):
        self.read = []
        super().__init__(self.row, period=PERIOD, inputs=[*ENCODERS, *GAUGES], name="learned")
        self.torques = torques

    def row(self, k, t, y):
        """Torques of a sample."""
        self.read.append(y.copy())
        return self.torques[min(k, len(self.torques) - 1)]


def best_change(model, error, deviation=1e-4, effort=1.0):
    """Torques (k, motors) that take an error (k + 1, 2) of the end-effector away, in the sense of least squares.

    Minimum of the sum of |z + error|^2 / deviation^2 + |u|^2 / effort^2 for a sampled model with outputs z: the
    linear-quadratic problem whose future is known.
    """
    places = [[one.name for one in model.outputs].index(name) for name in ("x", "y")]
    C, Phi, Gamma = model.C[:, places], model.Phi, model.Gamma
    P, p = C[-1].T @ C[-1] / deviation**2, C[-1].T @ error[-1] / deviation**2
    gains = []
    for k in reversed(range(len(Phi))):
        H = np.eye(Gamma.shape[2]) / effort**2 + Gamma[k].T @ P @ Gamma[k]
        K = np.linalg.solve(H, Gamma[k].T @ np.column_stack([P @ Phi[k], p]))
        gains.append(K)
        closed = Phi[k] - Gamma[k] @ K[:, :-1]
        p = C[k].T @ error[k] / deviation**2 + closed.T @ p
        P = C[k].T @ C[k] / deviation**2 + Phi[k].T @ P @ closed
    x, change = np.zeros(len(P)), []
    for k, K in enumerate(reversed(gains)):
        change.append(-K[:, :-1] @ x - K[:, -1])
        x = Phi[k] @ x + Gamma[k] @ change[-1]
    return np.array(change)


def learned(task, simulation, runs=3):
    """Torques that bring the flexible mechanism onto the path, and what sensors then read."""
    small = pf.reduced_mechanism(task, 16)
    coarse = pf.plan(small, task.path, duration=float(task.motion.t[-1]), samples=71)
    model = pf.linearise_along(coarse, mode=MODE).discretised(PERIOD, hold="zero")
    torques = np.zeros((len(model.Phi), len(task.mechanism.motors)))
    for _ in range(runs):
        run = simulation.run(Learned(torques), warning=False)
        torques = torques + best_change(model, run.driven.actual - run.driven.desired)
    table = Learned(torques)
    simulation.run(table, warning=False)
    return torques, np.array(table.read)


def design_of(task, states=STATES):
    """LQG about the start of a motion, against forces at the payload of 0.7 N up to 15 Hz."""
    model = pf.reduce(pf.linearise(task, mode=MODE, at=0.0, forces=[TIP]), states)
    below = scipy.signal.butter(2, 2 * np.pi * 15.0, analog=True)
    return pf.lqg(
        model, PERIOD, delay=PERIOD, measured=[*ENCODERS, *GAUGES], effort=dict.fromkeys(MOTORS, 1.0),
        deviations={"x": 2e-4, "y": 2e-4, **dict.fromkeys(ENCODERS, 0.03)},
        disturbance=dict.fromkeys(MOTORS, 0.3), coloured={f"{TIP}.x": (0.7, below), f"{TIP}.y": (0.7, below)},
        noise={**dict.fromkeys(ENCODERS, 1e-3), **dict.fromkeys(GAUGES, 3e-5)},
    )  # fmt: skip


def largest_radius(task, design, damping, payloads=(0.0, 0.12, 0.2, 0.5)):
    """Largest spectral radius of the full model along the path, and at its start with other payloads."""
    loaded = (task.remodelled(manipulator(one, damping)) for one in payloads)
    models = [*pf.poses_along(task, 8, mode=MODE).models, *(pf.linearise(one, mode=MODE, at=0.0) for one in loaded)]
    return max(pf.closed_loop(model, design).spectral_radius for model in models)


def least_margins(task, design):
    """Gain margin and delay margin [samples] of the weakest motor at the start."""
    rows = pf.margins(pf.linearise(task, mode=MODE, at=0.0), design).to_frame()
    return float(np.min(rows["gain_up"].to_numpy())), float(np.min(rows["samples"].to_numpy()))


def feedback(design, read, quantise=None):
    """The design as a controller about the learned motion, of which sensors read so much."""
    columns = {name: read[:, k] for k, name in enumerate([*ENCODERS, *GAUGES])}
    return pf.SampledController(
        design.law(), limits=20.0, quantise=quantise or {},
        reference={name: lambda t, one=one: one[min(round(t / PERIOD), len(one) - 1)] for name, one in columns.items()},
        name="lqg",
    )  # fmt: skip


def figures(run):
    """Root mean square of the error over the whole run, and of the vibration after the path [mm]."""
    late = run.driven.actual[run.task.motion.t > run.task.path.duration + 0.02]
    return 1e3 * run.driven.deviation, 1e3 * float(np.sqrt(np.mean(np.sum((late - late.mean(axis=0)) ** 2, axis=1))))


class Compared(NamedTuple):
    """Error and vibration [mm] by law and payload, largest spectral radius, least margins; the plan they are of."""

    found: dict
    radius: float
    margins: tuple
    task: object


def planned(damping=DAMPING):
    """The square with the payload that laws know."""
    return pf.plan(manipulator(PAYLOAD, damping), pf.load("raparm_i").paths["square"], duration=0.7)


def compared():
    """Laws with the payload they know and with 20 % more."""
    task = planned()
    heavy = task.remodelled(manipulator(1.2 * PAYLOAD))
    plants = {
        name: pf.Simulation(one, mode=MODE, feed_forward=True, options=OPTIONS)
        for name, one in (("as designed", task), ("20 % more payload", heavy))
    }
    torques, read = learned(task, plants["as designed"])
    design = design_of(task)
    laws = {
        "rigid torques": [],
        "learned torques": [Learned(torques)],
        "learned and LQG": [Learned(torques), feedback(design, read)],
        "quantised": [Learned(torques), feedback(design, read, RESOLUTION)],
    }
    found = {
        (law, name): figures(plant.run(list(laws[law]), warning=False))
        for law in laws
        for name, plant in plants.items()
    }
    return Compared(found, largest_radius(task, design, DAMPING), least_margins(task, design), task)


def radius_undamped():
    """Largest spectral radius of the design for undamped links."""
    task = planned(0.0)
    return largest_radius(task, design_of(task, STATES_UNDAMPED), 0.0)


def main():
    """Print the table, margins and spectral radii; what laws reach, and the radius without damping."""
    every, undamped = compared(), radius_undamped()
    found = every.found
    print(f"links damped by {100 * DAMPING:g} %: error, vibration after the path [mm]")
    for law in dict.fromkeys(law for law, _ in found):
        values = (f"{name}: {found[law, name][0]:.4f}, {found[law, name][1]:.4f};" for _, name in list(found)[:2])
        print(f"{law:16s}", *values)
    gain, delay = every.margins
    print(f"spectral radius up to {every.radius:.4f}, gain margin {gain:.2f}, delay margin {delay:.2f} samples")
    print(f"undamped links, {STATES_UNDAMPED} states: spectral radius up to {undamped:.4f}")
    return every, undamped


if __name__ == "__main__":
    main()
