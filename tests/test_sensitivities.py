"""Sensitivities: derivatives of runs against differences of runs and closed forms; their table, their command."""

import json
from dataclasses import replace
from pathlib import Path

import numpy as np
import pandas as pd
import pytest

import twins
from paraflex.cli.commands.studies import SensitivityRequest
from paraflex.cli.sensitivity import sensitivity_command
from paraflex.designs.derivatives.changes import Change
from paraflex.designs.derivatives.plans import nominal_values, run_inputs, size_of
from paraflex.designs.derivatives.stencil import STENCILS
from paraflex.designs.measure import SMOOTH, metric_values
from paraflex.designs.run import Task, plan_task, run_task
from paraflex.dynamics import State, build_system, constant_signals, numbers_of, pack_signals, same_layout
from paraflex.errors import InputError, NumericalError
from paraflex.fem import ModalBasis, modal_basis
from paraflex.files import load
from paraflex.integrators import IntegrationOptions, make_problem
from paraflex.integrators.sensitivity import Direction, run_derivatives
from paraflex.mechanism import Mechanism, PointRef, RevoluteJoint, RigidBody, TorsionalSpring, raparm_i
from paraflex.plots import elasticities
from paraflex.results.metrics import METRICS
from paraflex.results.run_traces import run_traces
from paraflex.studies import load_sensitivities, metric_gradients, sensitivities
from paraflex.tracking import simulate
from paraflex.writing import read_json
from shell import paraflex

EXAMPLE = Path(__file__).parents[1] / "examples" / "sensitivity_study.toml"
STUDY = """
mechanism = "raparm_i"
paths = ["line"]
modes = ["++++"]
duration = 0.06
samples = 13

[integration]
method = "tr-bdf2"
step = 2e-3
tolerance = 1e-7

[vary.arm]
fields = ["body.link1.length", "body.link1.points.B1"]

[vary.thickness]
fields = ["section.bar.thickness"]

[vary.lump]
fields = ["lump.joint.mass"]

[vary.modulus]
fields = ["material.aluminium.youngs_modulus"]

[vary.alpha]
fields = ["integration.alpha"]

[vary.acceleration]
fields = ["path.line.max_acceleration"]
"""
PARAMETERS = ("arm", "thickness", "lump", "modulus", "alpha", "acceleration")
AFTER = {"tracking_rms_after", "tracking_max_after", "residual_vibration", "drift_speed"}
# Central differences of fourth order, for a step of one.
PLACES = ((-2.0, 1.0 / 12.0), (-1.0, -8.0 / 12.0), (1.0, 8.0 / 12.0), (2.0, -1.0 / 12.0))


def write(folder, text=STUDY, **replaced):
    for old, new in replaced.items():
        assert old in text
        text = text.replace(old, new)
    file = folder / "study.toml"
    file.write_text(text, encoding="utf-8")
    return file


def only(*names):
    """The study with some of its parameters."""
    head, *tables = STUDY.split("[vary.")
    return head + "".join(f"[vary.{table}" for table in tables if table.split("]")[0] in names)


class Design:
    """A study's design, what its run is given, and what neighbours are."""

    def __init__(self, study):
        self.setting = study.setting
        self.task = Task(0, 0, nominal_values(study.setting), study.setting.paths[0])
        self.planned, self.options = plan_task(self.setting, self.task)
        self.given = run_inputs(self.planned, self.options, self.planned.torques(study.setting.modes[0]))

    def direction(self, k):
        size = size_of(self.setting, self.task, k)
        found = Change(self.setting, self.task, self.planned, k, size).of_mode(self.given)
        return found.direction, found.error

    def differences(self, k, step):
        """Of whole runs solved to rounding, by the parameter as a part of its size."""
        motions = []
        for place, _ in PLACES:
            values = list(self.task.values)
            values[k] *= 1.0 + place * step
            planned, options = plan_task(self.setting, self.task._replace(values=tuple(values)))
            planned = replace(planned, system=build_system(planned.mechanism, like=self.planned.system))
            near = run_inputs(planned, options, twins.feed_forward_like(planned.plan, self.given.torques))
            motions.append(run_derivatives(near.problem, options, []).motion)
        return [
            sum(weight * part for (_, weight), part in zip(PLACES, parts, strict=True)) / step
            for parts in zip(*motions, strict=True)
        ]


@pytest.fixture(scope="module")
def design(tmp_path_factory):
    return Design(load_sensitivities(write(tmp_path_factory.mktemp("design"))))


# Differences leave their truncation, and rounding of the stiffnesses over the step.
STEPS = {"arm": 2e-4, "thickness": 3e-4, "lump": 1e-2, "modulus": 1e-3, "alpha": 1e-2, "acceleration": 2e-4}


@pytest.mark.parametrize("name", PARAMETERS)
def test_motion_against_differences_of_whole_runs(design, name):
    """With the run's own steps; where the acceleration of the path varies, these move with its end."""
    k = PARAMETERS.index(name)
    direction, error = design.direction(k)
    assert error < 1e-12
    found = run_derivatives(design.given.problem, design.options, [direction])
    assert found.residual < 1e-8
    for kind, exact, expected in zip(
        found.motion._fields, found.derivatives, design.differences(k, STEPS[name]), strict=True
    ):
        assert np.abs(exact[0] - expected).max() < 3e-6 * np.abs(expected).max(), kind


def test_metrics_against_differences_of_sweep_runs(tmp_path):
    """Of the runs that `paraflex sweep` makes, whose Newton iterations leave what the tolerance allows."""
    design = Design(load_sensitivities(write(tmp_path, STUDY.replace("tolerance = 1e-7", "tolerance = 1e-9"))))
    ((mode, values, gradients),) = metric_gradients(design.setting, design.task)
    assert mode == "++++"
    # No sample is after the motion, and no material has a strength: no number and no derivative.
    names = [name for name in gradients if np.isfinite(values[name])]
    assert set(gradients) - set(names) == {*AFTER, "safety_factor_min"}
    assert all(np.isnan(gradients[name]).all() for name in AFTER)
    steps = dict.fromkeys(PARAMETERS, 3e-4)
    for k, name in enumerate(PARAMETERS):
        rows = []
        for place, _ in PLACES:
            moved = list(design.task.values)
            moved[k] *= 1.0 + place * steps[name]
            rows.append(run_task(design.setting, design.task._replace(values=tuple(moved))).rows[0])
        for metric in names:
            expected = sum(weight * row[metric] for (_, weight), row in zip(PLACES, rows, strict=True)) / steps[name]
            exact = gradients[metric][k] * design.task.values[k]
            assert exact == pytest.approx(expected, rel=1e-3, abs=1e-5 * abs(values[metric])), (name, metric)


@pytest.mark.parametrize("geometry", ["linear", "second-order"])
def test_metrics_of_the_time_after_the_motion_against_differences(tmp_path, geometry):
    """Derivatives of the error after the motion, drift and vibration about it, and deflection from the chord."""
    asked = ["tracking_rms_motion", "tracking_max_motion", *sorted(AFTER), "deflection_max"]
    text = only("thickness", "arm").replace("samples = 13", f"samples = 46\nmetrics = {json.dumps(asked)}")
    text = text.replace("duration = 0.06", "duration = 0.18").replace("tolerance = 1e-7", "tolerance = 1e-9")
    study = load_sensitivities(write(tmp_path, text))
    setting = replace(study.setting, data=dict(study.setting.data) | {"geometry": geometry})
    task = Task(0, 0, nominal_values(setting), "line")
    ((_, values, gradients),) = metric_gradients(setting, task)
    # The indicator of validity has no smooth form.
    assert list(gradients) == asked
    assert list(values) == [*asked, "validity"]
    for k, value in enumerate(task.values):
        rows = []
        for place, _ in PLACES:
            moved = list(task.values)
            moved[k] = value * (1.0 + 3e-4 * place)
            rows.append(run_task(setting, task._replace(values=tuple(moved))).rows[0])
        for metric in asked:
            expected = sum(weight * row[metric] for (_, weight), row in zip(PLACES, rows, strict=True)) / 3e-4
            assert gradients[metric][k] * value == pytest.approx(expected, rel=1e-3, abs=1e-5 * abs(values[metric])), (
                metric
            )


def test_brakes_have_no_derivatives(tmp_path):
    study = load_sensitivities(write(tmp_path, only("thickness").replace("duration = 0.06", "duration = 0.14")))
    data = dict(study.setting.data)
    setting = replace(study.setting, data=data | {"study": dict(data["study"]) | {"after": "hold"}})
    with pytest.raises(InputError, match=r"study.after: derivatives do not go through the engagement of brakes"):
        metric_gradients(setting, Task(0, 0, nominal_values(setting), "line"))


def test_second_order_geometry(tmp_path):
    text = only("thickness").replace("duration = 0.06", "duration = 0.01").replace("samples = 13", "samples = 3")
    study = load_sensitivities(write(tmp_path, text))
    data = dict(study.setting.data) | {"geometry": "second-order"}
    bent = Design(replace(study, setting=replace(study.setting, data=data)))
    assert bent.planned.system.packed.bending is not None
    found = run_derivatives(bent.given.problem, bent.options, [bent.direction(0)[0]])
    for exact, expected in zip(found.derivatives, bent.differences(0, 1e-3), strict=True):
        assert np.abs(exact[0] - expected).max() < 1e-5 * np.abs(expected).max()


def test_gains_that_follow_the_step(tmp_path):
    text = only("acceleration").replace("tolerance = 1e-7", "tolerance = 1e-7\nautomatic_gains = true")
    followed = Design(load_sensitivities(write(tmp_path, text)))
    found = run_derivatives(followed.given.problem, followed.options, [followed.direction(0)[0]])
    for exact, expected in zip(found.derivatives, followed.differences(0, 2e-4), strict=True):
        assert np.abs(exact[0] - expected).max() < 3e-6 * np.abs(expected).max()


def oscillator(stiffness, inertia=0.02):
    """A body on a torsional spring: theta'' = -stiffness / inertia theta."""
    return Mechanism(
        name="oscillator",
        ground={"O": (0.0, 0.0)},
        bodies=(RigidBody("wheel", 0.5, inertia, (0.0, 0.0), {"O": (0.0, 0.0)}),),
        joints=(RevoluteJoint("pin", PointRef("ground", "O"), PointRef("wheel", "O")),),
        springs=(TorsionalSpring("spring", "pin", stiffness),),
    )


@pytest.mark.parametrize("step", [5e-4, None])
def test_oscillator_has_the_derivative_of_its_cosine(step):
    """d cos(omega t) / d ln k = -omega t / 2 sin(omega t), and of the rate likewise; with fixed and chosen steps."""
    stiffness, amplitude, times = 3.0, 0.1, np.linspace(0.0, 0.6, 13)
    system = build_system(oscillator(stiffness))
    packed = [numbers_of(build_system(oscillator(stiffness * (1.0 + e))).packed) for e in (-1e-4, 1e-4)]
    signals, _ = pack_signals(system.mechanism, constant_signals([], 1.0), 1.0)
    initial = State(0.0, np.array([0.0, 0.0, amplitude]), np.zeros(3))
    options = IntegrationOptions(method="esdirk5", tolerance=1e-9, step=step)
    problem = make_problem(system, signals, initial, times)
    direction = Direction(
        packed=(packed[1] - packed[0]) / 2e-4,
        signals=np.zeros_like(numbers_of(signals)),
        q=np.zeros(3),
        v=np.zeros(3),
        stops=np.zeros_like(problem.stops),
        times=np.zeros_like(times),
        gains=np.zeros(2),
    )
    found = run_derivatives(problem, options, [direction])
    omega = np.sqrt(stiffness / 0.02)
    phase = omega * times
    expected = -amplitude * 0.5 * phase * np.sin(phase)
    rate = -amplitude * 0.5 * omega * (np.sin(phase) + phase * np.cos(phase))
    assert found.motion.q[:, 2] == pytest.approx(amplitude * np.cos(phase), abs=1e-8)
    assert found.derivatives.q[0, :, 2] == pytest.approx(expected, abs=1e-7)
    assert found.derivatives.v[0, :, 2] == pytest.approx(rate, abs=2e-6)


@pytest.fixture(scope="module")
def found(tmp_path_factory):
    text = only("arm", "thickness").replace('modes = ["++++"]', 'modes = ["++++", "+++-"]')
    return sensitivities(write(tmp_path_factory.mktemp("found"), text.replace("duration = 0.06", "duration = 0.02")))


def test_mass_and_elasticities(found):
    """The mass of eight links is rho w t (6 0.25 + 2 0.1) and that of lumps."""
    assert found.rows == (("line", "++++"), ("line", "+++-"))
    assert found.parameters == ("arm", "thickness")
    assert "steps" not in found.metrics
    mass = found.metrics.index("total_mass")
    assert found.units[mass] == "kg"
    assert found.derivatives[0, mass] == pytest.approx([2700.0 * 0.03 * 0.005, 2700.0 * 0.03 * 1.7], rel=1e-9)
    passive = found.metrics.index("peak_torque.tau6")
    assert np.isnan(found.relative[1, passive]).all()
    assert found.relative[0, passive] == pytest.approx(
        found.nominal * found.derivatives[0, passive] / found.values[0, passive], rel=1e-12
    )
    assert found.relative[1, mass, 1] == pytest.approx(2700.0 * 0.03 * 1.7 * 0.005 / found.values[1, mass], rel=1e-9)
    lines = found.to_frame()
    assert len(lines) == 2 * len(found.metrics) * 2
    line = lines[(lines["mode"] == "+++-") & (lines["metric"] == "total_mass") & (lines["parameter"] == "thickness")]
    assert line["derivative"].item() == found.derivatives[1, mass, 1]
    told = found.to_dict()["runs"][1]["metrics"]
    assert told["total_mass"]["derivatives"]["thickness"] == found.derivatives[1, mass, 1]
    # No sample is after the motion: no number.
    assert told["residual_vibration"]["value"] is None


def test_another_nominal_point(tmp_path):
    text = only("thickness").replace("duration = 0.06", 'duration = 0.01\nmetrics = ["total_mass", "rms_torque"]')
    at = sensitivities(write(tmp_path, text), at={"thickness": 0.006})
    assert at.nominal == pytest.approx([0.006])
    assert at.metrics == ("total_mass", *(f"rms_torque.{motor}" for motor in ("tau1", "tau2", "tau5", "tau6")))
    assert at.relative[0, 0, 0] == pytest.approx(2700.0 * 0.03 * 1.7 * 0.006 / at.values[0, 0], rel=1e-9)


def test_smooth_metrics_are_the_metrics(design):
    run = simulate(design.planned, "++++", options=design.options)
    traces = run_traces(run)
    motion = ("t", "q", "v", "a", "work", "kinetic_energy", "strain_energy")
    stepped = replace(run.solution, **{name: getattr(run.solution, name) + 0j for name in motion})
    moved = run_traces(replace(run, solution=stepped))
    for name in SMOOTH:
        expected = np.ravel(METRICS[name].value(traces))
        values = metric_values(moved, traces, (name,))
        assert values.real == pytest.approx(expected, rel=1e-12, nan_ok=True), name
        assert not np.any(np.nan_to_num(values.imag))


def test_a_metric_decides_where_the_nominal_run_does(design):
    """A maximum stays where it was, though another sample is larger in the run near by."""
    traces = run_traces(simulate(design.planned, "++++", options=design.options))
    other = replace(traces, distance=traces.distance[::-1].copy(), torque=traces.torque[::-1].copy())
    at = int(np.argmax(traces.distance))
    assert metric_values(other, traces, ("tracking_max",))[0] == other.distance[at] != traces.distance[at]
    k, motor = np.unravel_index(np.argmax(np.abs(traces.torque)), traces.torque.shape)
    expected = np.sign(traces.torque[k, motor]) * other.torque[k, motor]
    assert metric_values(other, traces, ("peak_torque_max",))[0] == expected


@pytest.mark.parametrize("stencil", STENCILS)
def test_differences_of_high_order(stencil):
    difference = stencil.derivative([np.array([np.exp(2.0 * place), 3.0]) for place in stencil.places])
    assert difference.value == pytest.approx([2.0, 0.0], abs=2e-11)
    assert difference.error[0] < 1e-8
    assert np.abs(difference.value[0] - 2.0) < difference.error[0] + 1e-12


def test_modes_keep_order_and_sign():
    """Told by overlap: a shuffled basis with signs turned round is put back, and one of fewer modes is found."""
    integrals = build_system(raparm_i()).bodies[3].shape.integrals
    modes = modal_basis(integrals)
    order = np.random.default_rng(2).permutation(modes.omega.size)
    signs = np.where(order % 2, 1.0, -1.0)
    shuffled = replace(modes, omega=modes.omega[order], vectors=modes.vectors[:, order] * signs)
    back = shuffled.like(modes, integrals.Mff)
    assert np.array_equal(back.omega, modes.omega)
    assert np.array_equal(back.vectors, modes.vectors)
    assert np.array_equal(
        shuffled.like(ModalBasis(modes.omega[:3], modes.vectors[:, :3]), integrals.Mff).omega, modes.omega[:3]
    )


def test_systems_of_another_layout_are_told_apart():
    packed = build_system(raparm_i()).packed
    assert same_layout(packed, build_system(raparm_i().with_beams(elements=None)).packed)
    assert not same_layout(packed, build_system(raparm_i().rigid()).packed)


@pytest.mark.parametrize(
    ("replaced", "says"),
    [
        ({'"tr-bdf2"': '"newmark"'}, "method: derivatives need another method (got 'newmark'); choose from "),
        (
            {"tolerance = 1e-7": 'tolerance = 1e-7\nconstraints = "projection"'},
            "constraints: derivatives need Baumgarte's treatment of the constraints",
        ),
        ({"section.bar.thickness": "body.link1.elements"}, "body.link1.elements: should be a valid integer"),
        ({"section.bar.thickness": "integration.step"}, "vary.thickness: has no derivative"),
        (
            {"section.bar.thickness": "integration.gamma"},
            "vary.thickness.fields: not a numeric option of the integration",
        ),
        ({"section.bar.thickness": "ground.A1.1"}, "vary.thickness: is zero, so steps of differences have no size"),
        ({'thickness"]': 'thickness", "section.bar.width"]'}, "vary.thickness.fields: its fields have different"),
        ({"samples = 13": 'samples = 13\nmetrics = ["steps"]'}, "metrics: has no derivative (got 'steps')"),
        ({"samples = 13": 'samples = 13\nmetrics = ["work_done"]'}, "metrics: unknown metric (got 'work_done')"),
        ({'[vary.thickness]\nfields = ["section.bar.thickness"]': ""}, "vary: no parameters to differentiate by"),
    ],
)
def test_bad_input(tmp_path, replaced, says):
    with pytest.raises(InputError) as caught:
        sensitivities(write(tmp_path, only("thickness"), **replaced))
    assert says in str(caught.value)


def test_a_size_for_a_number_that_is_zero(tmp_path):
    text = only("thickness").replace('["section.bar.thickness"]', '["ground.A1.1"]\nlow = -0.1\nhigh = 0.1')
    text = text.replace("duration = 0.06", 'duration = 0.01\nmetrics = ["rms_torque_norm"]')
    found = sensitivities(write(tmp_path, text))
    assert np.isfinite(found.derivatives).all()
    assert np.abs(found.derivatives).max() > 0.0
    assert found.errors.max() < 1e-6 * np.abs(found.derivatives).max()


def test_a_parameter_at_its_bound_is_moved_to_one_side(tmp_path):
    """Masses are not negative; the derivative of the mass is one a joint and end."""
    text = only("lump").replace('["lump.joint.mass"]', '["lump.joint.inertia"]\nlow = 0.0\nhigh = 1e-4')
    text = text.replace("duration = 0.06", 'duration = 0.01\nmetrics = ["rms_torque_norm"]')
    study = load_sensitivities(write(tmp_path, text))
    near, far = (sensitivities(study, at={"lump": value}) for value in (0.0, 1e-9))
    assert near.derivatives == pytest.approx(far.derivatives, rel=1e-4)


def test_unknown_point_and_a_run_that_fails(tmp_path):
    study = load_sensitivities(write(tmp_path, only("thickness")))
    with pytest.raises(InputError, match="--at: unknown parameter"):
        sensitivities(study, at={"thicknes": 0.006})
    with pytest.raises(InputError, match="--at: not a number"):
        sensitivities(study, at={"thickness": float("nan")})
    stopped = replace(
        study, setting=replace(study.setting, integration=dict(study.setting.integration) | {"max_steps": 3})
    )
    with pytest.raises(NumericalError, match="has not ended after 3 steps, at t = "):
        sensitivities(stopped)


def test_command(tmp_path):
    text = only("thickness").replace("duration = 0.06", 'duration = 0.01\nmetrics = ["tracking_rms", "total_mass"]')
    file, out = write(tmp_path, text), tmp_path / "out"
    done = paraflex("sensitivity", str(file), "--output", str(out))
    assert done.returncode == 0, done.stderr
    assert "RMS tracking error" in done.stdout
    assert "…" not in done.stdout
    figures = json.loads((out / "sensitivity.json").read_text())
    assert figures["parameters"]["thickness"] == {"value": 0.005, "fields": ["section.bar.thickness"]}
    lines = pd.read_parquet(out / "sensitivity.parquet")
    assert list(lines["metric"]) == ["tracking_rms", "total_mass"]
    assert pd.read_csv(out / "sensitivity.csv")["derivative"].tolist() == pytest.approx(list(lines["derivative"]))
    assert {entry.name for entry in (out / "figures").iterdir()} == {
        f"elasticities_line_++++.{x}" for x in ("png", "svg")
    }
    with pytest.raises(InputError, match="no such run"):
        elasticities(figures, 1)


def test_command_again_and_elsewhere(tmp_path, capsys):
    """Again is the same; another point takes its place, and says so; another kind of results stays."""
    text = only("thickness").replace("duration = 0.06", 'duration = 0.01\nmetrics = ["rms_torque"]')
    file, out = write(tmp_path, text), tmp_path / "out"

    def ask(output=out, at=(), metrics=(), as_json=True):
        return sensitivity_command(
            SensitivityRequest(study=str(file), output=str(output), at=list(at), metrics=list(metrics), json=as_json)
        )

    assert ask() == 0
    figures = json.loads(capsys.readouterr().out)
    assert ask(as_json=False) == 0
    printed = capsys.readouterr().out
    assert "of τ₆" in printed
    assert "N m" in printed
    assert read_json(out / "sensitivity.json") == figures
    capsys.readouterr()
    assert ask(at=["thickness=0.006"]) == 0
    assert 'holds sensitivities "sweep"' in capsys.readouterr().err
    assert read_json(out / "sensitivity.json")["parameters"]["thickness"]["value"] == 0.006
    (tmp_path / "verify.json").write_text("{}", encoding="utf-8")
    with pytest.raises(InputError, match="--output: the folder holds other results, a verification"):
        ask(output=tmp_path)
    with pytest.raises(InputError, match=r"--at: not NAME=VALUE .got 'thickness'"):
        ask(at=["thickness"])
    with pytest.raises(InputError, match=r"metrics: has no derivative .got 'steps'"):
        ask(metrics=["work, steps"])


def test_example_is_a_study():
    study = load_sensitivities(EXAMPLE)
    assert nominal_values(study.setting) == (0.005, 0.25, 0.225, 0.13, 70e9)


def test_a_beam_whose_mesh_changes_with_its_length_has_no_derivative():
    """Its point stays where it was, so that the longer beam has an element more, and the shorter one is invalid."""
    study = {"mechanism": "raparm_i", "modes": ["++++"], "vary": {"arm": {"fields": ["link1.length"]}}}
    with pytest.raises(InputError, match=r"vary\.arm: has no derivative: .*; vary with it what has to change too"):
        sensitivities(study)


def test_a_beam_of_another_mesh_is_named():
    first, second = (load("raparm_i", set={"link1.length": length}).mechanism for length in (0.25, 0.26))
    with pytest.raises(InputError, match=r"body\.link1: its mesh has 24 flexible coordinates instead of 12"):
        build_system(second, build_system(first))
