"""Numbers of a pose on the page, forces that bend links, linear models, and the sentence before a run."""

import json
import math
import tomllib
from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest

import paraflex as pf
from paraflex.actuation import actuation_condition
from paraflex.dynamics import State, build_system, undeformed
from paraflex.errors import AssemblyError, InputError
from paraflex.files.library import library_names, library_text
from paraflex.files.model import model_of_text
from paraflex.mechanism import RigidBody
from paraflex.workbench.bending import _undeformed, drag_force, linear
from paraflex.workbench.document import Document
from paraflex.workbench.moving import Mover
from paraflex.workbench.readiness import checked
from paraflex.workbench.seeing import Seeing
from paraflex.workbench.session import EditSession

G = 9.81
ARM = f"""
name = "arm"
gravity = [0.0, {-G}]
[ground]
A = [0.0, 0.0]
[body.upper]
mass = 2.0
inertia = 0.01
centre_of_mass = [0.3, 0.0]
points = {{ A = [0.0, 0.0], B = [0.5, 0.0] }}
[joint]
A = ["ground.A", "upper.A"]
[motor]
shoulder = "A"
[end_effector]
point = "upper.B"
coordinates = ["x", "y"]
[assembly.drawn]
upper = 0.4
"""
FOREARM = """
lower = 1.1
[body.lower]
mass = 1.5
inertia = 0.01
centre_of_mass = [0.2, 0.05]
points = { B = [0.0, 0.0], C = [0.4, 0.0] }
[joint.B]
type = "revolute"
points = ["upper.B", "lower.B"]
[motor.elbow]
joint = "B"
"""
CANTILEVER = """
name = "cantilever"
[ground]
A = [0.0, 0.0]
[section.bar]
width = 0.02
thickness = 0.004
[material.steel]
youngs_modulus = 2.1e11
density = 7850
[body.beam]
type = "beam"
length = 0.5
section = "bar"
material = "steel"
points = { A = 0.0, T = 0.5 }
[joint.A]
type = "weld"
points = ["ground.A", "beam.A"]
angle = 0.0
[end_effector]
point = "beam.T"
[assembly.straight]
beam = 0.0
"""
EI, EA, LENGTH = 2.1e11 * 0.02 * 0.004**3 / 12.0, 2.1e11 * 0.02 * 0.004, 0.5
SPRING = """
[spring.coil]
joint = "A"
stiffness = 3.0
rest = 0.1
"""
PULL = """
[linear_spring.pull]
points = ["ground.D", "upper.B"]
stiffness = 40.0
length = 0.2
"""


def read(text):
    """The model of a text, and the pose of its assembly."""
    model = model_of_text(text, "model.toml", Path())
    return model, Mover(model.mechanism, model.study.assembly).q


def five_bar(proximal1, distal1, proximal2, distal2):
    """The five-bar in a pose by its angles."""
    text = library_text("five_bar")
    for old, new in (("2.16", proximal1), ("0.25\nprox", distal1), ("0.98", proximal2), ("2.89", distal2)):
        tail = "\nprox" if "prox" in old else ""
        text = text.replace(f"= {old}", f"= {new!r}{tail}")
    return read(text)


def leg(base, point, side):
    """The angles of the two links, 0.25 m each, of a leg from a base pivot to a point; the elbow lies on a side."""
    way = np.subtract(point, base)
    half, along = math.acos(min(1.0, np.hypot(*way) / 0.5)), math.atan2(way[1], way[0])
    return along + side * half, along - side * half


def torques(text, **more):
    """The holding torques of a text, motors of all modes."""
    model, q = read(text)
    return Seeing(model).quick(q, more.get("mode", ""))["torques"]


class TestReasons:
    """Why a number is not known, or what it leaves out."""

    @pytest.mark.parametrize(
        ("text", "reason"),
        [
            (ARM.partition("[end_effector]")[0] + "[assembly.drawn]\nupper = 0.4\n", "no end-effector"),
            (ARM, "the task has 2 coordinates, the mechanism 1 degree of freedom"),
            (ARM.replace('[motor]\nshoulder = "A"', "").replace('"x", "y"', '"x"'), "no motors"),
            (
                (ARM + FOREARM).replace('[motor.elbow]\njoint = "B"', "").replace('"upper.B"\nco', '"lower.C"\nco'),
                "the motors drive 1 of 2 degrees of freedom",
            ),
            (
                (ARM + FOREARM).replace('"upper.B"\nco', '"lower.C"\nco').replace("lower = 1.1", "lower = 0.4"),
                "the end-effector is in a singular position (serial, type I)",
            ),
        ],
    )
    def test_no_condition(self, text, reason):
        model, q = read(text)
        found = Seeing(model).quick(q, "")
        assert (found["condition"], found["why"]["condition"]) == (None, reason)

    def test_no_reason_for_a_condition(self):
        model, q = read((ARM + FOREARM).replace('"upper.B"\nco', '"lower.C"\nco'))
        found = Seeing(model).quick(q, "")
        assert found["condition"] > 1.0
        assert "condition" not in found["why"]

    def test_loads_that_vary_in_time_are_named(self):
        text = CANTILEVER + '\n[load.gust]\ntype = "force"\nbody = "beam"\npoint = "T"\nforce = [0.0, "sin(3*t)"]\n'
        model, q = read(text.replace('body = "beam"\npoint = "T"', 'point = "beam.T"'))
        why = Seeing(model).full(q, "")["why"]
        assert why["loads"] == "frequencies and compliance leave out loads that vary in time: gust"
        model, q = read(CANTILEVER)
        assert "loads" not in Seeing(model).full(q, "")["why"]


class TestHoldingTorques:
    """Torques that hold gravity, loads and springs, by closed forms; positive on the second body of the joint."""

    def test_weight_of_a_pendulum(self):
        weight = 2.0 * G * 0.3 * math.cos(0.4)
        assert torques(ARM)["shoulder"] == pytest.approx(weight, rel=1e-9)
        turned = ARM.replace('A = ["ground.A", "upper.A"]', 'A = ["upper.A", "ground.A"]')
        assert torques(turned)["shoulder"] == pytest.approx(-weight, rel=1e-9)

    def test_two_links(self):
        found = torques(ARM + FOREARM)
        lower = 1.5 * G * (0.2 * math.cos(1.1) - 0.05 * math.sin(1.1))
        assert found["elbow"] == pytest.approx(lower, rel=1e-9)
        upper = (2.0 * 0.3 + 1.5 * 0.5) * G * math.cos(0.4)
        assert found["shoulder"] == pytest.approx(upper + lower, rel=1e-9)

    @pytest.mark.parametrize("force", ["[2.0, -7.0]", '["2.0 * cos(t)", "t - 7.0"]'])
    def test_loads_constant_and_in_time(self, force):
        load = f'[load.tool]\ntype = "force"\npoint = "upper.B"\nforce = {force}\n'
        moment = 0.5 * (-7.0 * math.cos(0.4) - 2.0 * math.sin(0.4))
        assert torques(ARM + load)["shoulder"] - torques(ARM)["shoulder"] == pytest.approx(-moment, rel=1e-9)

    def test_springs(self):
        assert torques(ARM + SPRING)["shoulder"] - torques(ARM)["shoulder"] == pytest.approx(3.0 * 0.3, rel=1e-9)
        text = ARM.replace("A = [0.0, 0.0]\n[body", "A = [0.0, 0.0]\nD = [0.1, 0.6]\n[body", 1)
        tip = 0.5 * np.array([math.cos(0.4), math.sin(0.4)])
        way = np.array([0.1, 0.6]) - tip
        pull = 40.0 * (np.hypot(*way) - 0.2) * way / np.hypot(*way)
        moment = tip[0] * pull[1] - tip[1] * pull[0]
        assert torques(text + PULL)["shoulder"] - torques(ARM)["shoulder"] == pytest.approx(-moment, rel=1e-9)

    def test_drive_in_place_of_a_motor(self):
        text = ARM.replace('[motor]\nshoulder = "A"', '[prescribed.crank]\njoint = "A"\nspeed = 2.0')
        assert torques(text)["A"] == pytest.approx(2.0 * G * 0.3 * math.cos(0.4), rel=1e-9)

    def test_nothing_holds_a_pendulum(self):
        model, q = read(library_text("pendulum"))
        found = Seeing(model).quick(q, "")
        assert found["torques"] is None
        assert "cannot hold" in found["why"]["torques"]

    def test_least_norm_as_planned(self):
        model = model_of_text(f"gravity = [1.0, {-G}]\n" + library_text("raparm_i"), "model.toml", Path())
        task = pf.plan(model, "square", duration=2.0 * model.paths["square"].duration, samples=11)
        mode = next(one for one in model.mechanism.modes if one.name == "++++")
        planned = task.torques(mode).evaluate(task.motion.t)[-1]
        found = Seeing(model).quick(task.motion.q[-1], "++++")["torques"]
        names = [motor.name for motor in model.mechanism.motors]
        expected = {name: planned[names.index(name)] for name in mode.motors}
        assert found == pytest.approx(expected, rel=1e-6, abs=1e-9 * max(map(abs, expected.values())))


class TestFreedoms:
    """Degrees of freedom, condition and singular positions."""

    @pytest.mark.parametrize("name", library_names())
    def test_numbers_of_library_mechanisms(self, name):
        model, q = read(library_text(name))
        seen = Seeing(model)
        for mode in ["", *(one.name for one in model.mechanism.modes)]:
            json.dumps(seen.full(q, mode), allow_nan=False)
        bodies = [replace(one, mass=0.0, inertia=0.0) if isinstance(one, RigidBody) else one
                  for one in model.mechanism.bodies]  # fmt: skip
        bare = replace(model, mechanism=replace(model.mechanism, bodies=tuple(bodies)))
        found = Seeing(bare).full(q, "")
        rigid = any(isinstance(one, RigidBody) for one in bodies)
        whole = seen.full(q, "")
        for number in ("freedoms", "drives"):
            assert found[number] == whole[number]
        for number in ("serial", "parallel", "condition"):
            assert [found[number] or 0.0] == pytest.approx([whole[number] or 0.0], rel=1e-6)
        assert (found["held"] is None and found["torques"] is None) or not rigid

    @pytest.mark.parametrize("name", library_names())
    def test_changed_model_as_if_new(self, name):
        model, q = read(library_text(name))
        seen, random = Seeing(model), np.random.default_rng(46)
        seen.full(q, "")
        given = tomllib.loads(library_text(name)).get("parameters", {})
        numbers = sorted(key for key, value in given.items() if isinstance(value, float) and value > 0.0)
        for parameter in random.permutation(numbers)[:3]:
            try:
                other = pf.load(name, set={f"parameters.{parameter}": 1.01 * given[parameter]})
                pose = Mover(other.mechanism, other.study.assembly).q
            except (AssemblyError, InputError):
                continue
            changed, fresh = Seeing(other, seen).full(pose, ""), Seeing(other).full(pose, "")
            for key in ("held", "unheld", "condition", "path"):
                assert np.ravel(changed[key] or 0.0) == pytest.approx(np.ravel(fresh[key] or 0.0), rel=1e-6)

    @pytest.mark.parametrize("name", library_names())
    def test_numbers_on_the_way_of_a_drag(self, name):
        model, _ = read(library_text(name))
        mover, random = Mover(model.mechanism, model.study.assembly), np.random.default_rng(7)
        seen, body = Seeing(model), model.mechanism.bodies[-1]
        for to in mover.system.size * random.normal(size=(6, 2)):
            mover.drag(body.name, [0.0, 0.0], to.tolist())
            found = seen.full(mover.q, model.mechanism.modes[0].name if model.mechanism.modes else "")
            json.dumps(found, allow_nan=False)
            assert found["serial"] is None or 0.0 <= found["serial"] <= 1.0 + 1e-9

    def test_condition_as_along_the_path(self):
        model = pf.load("five_bar")
        task = pf.plan(model, "square", samples=21)
        mode, seen = model.mechanism.modes[0], Seeing(model)
        expected = actuation_condition(task.effort, mode)
        found = [seen.quick(q, "++")["condition"] for q in task.motion.q]
        assert found == pytest.approx(expected, rel=1e-6)

    def test_stretched_leg_is_serial(self):
        point = (-0.1 + 0.5 * math.cos(1.2), 0.5 * math.sin(1.2))
        model, q = five_bar(1.2, 1.2, *leg((0.1, 0.0), point, -1.0))
        found = Seeing(model).quick(q, "++")
        assert found["serial"] < 1e-7 < 0.05 < found["parallel"]

    def test_distal_links_in_line_are_parallel(self):
        model, q = five_bar(math.acos(-0.6), 0.0, math.acos(0.6), math.pi)
        found = Seeing(model).quick(q, "++")
        assert found["parallel"] < 1e-7 < 0.05 < found["serial"]

    def test_reach_of_a_path(self):
        line = '[path.up]\ntype = "line"\nstart = [0.0, {}]\nend = [0.0, {}]\nmax_acceleration = 10.0\n'
        text = library_text("five_bar").replace('path = "square"', 'path = "up"') + line.format(0.3, 0.6)
        model, _ = read(text)
        limit = math.sqrt(0.5**2 - 0.1**2)
        path = np.array(Seeing(model).reach("++"))
        assert np.array_equal(path[:, 2] > 0, path[:, 1] < limit)
        assert 0 < np.sum(path[:, 2] > 0) < len(path)
        model, _ = read(text.replace("0.6]", "0.48989]"))
        path = np.array(Seeing(model).reach("++"))
        assert path[0, 2] == 1
        assert path[-1, 2] == 2


class TestElasticity:
    """Frequencies and compliance, by closed forms and by other ways to compute them."""

    @pytest.mark.parametrize("name", ["five_bar", "raparm_i", "3rrr", "four_bar", "leaf_spring_guide"])
    def test_frequencies_as_of_linear_models(self, name):
        model, q = read(library_text(name))
        found, motors = Seeing(model).full(q, ""), model.mechanism.motors
        drives = [one.name for one in model.mechanism.prescribed]
        force = ["stage.T"] if name == "leaf_spring_guide" else []
        system, rigid = build_system(model.mechanism), build_system(model.mechanism.rigid())
        made = pf.linearise(model, forces=force, start=undeformed(system, rigid, State(0.0, q, np.zeros_like(q))))
        held, free = (part[part > 0.0][:3] / (2.0 * np.pi) for part in (made.held_frequencies(), made.frequencies))
        if motors or drives:
            assert found["held"] == pytest.approx(held, rel=1e-6)
        if motors or not drives:
            assert found["unheld"] == pytest.approx(free, rel=1e-6)

    def test_cantilever(self):
        model, q = read(CANTILEVER)
        found = Seeing(model).full(q, "")
        assert found["compliance"]["sizes"] == pytest.approx([LENGTH**3 / (3.0 * EI), LENGTH / EA], rel=1e-6)
        assert found["compliance"]["angle"] == pytest.approx(np.pi / 2.0, abs=1e-6)
        first = 1.8751041**2 * math.sqrt(EI / (7850 * 0.02 * 0.004 * LENGTH**4)) / (2.0 * math.pi)
        assert found["unheld"][0] == pytest.approx(first, rel=2e-3)

    def test_compliance_with_the_motors_of_the_mode_held(self):
        model, q = read(library_text("raparm_i"))
        seen, joint = Seeing(model), {motor.name: motor.joint for motor in model.mechanism.motors}
        start, at = _undeformed(replace(model.mechanism, prescribed=()), q), str(model.mechanism.end_effector.point)
        for mode in model.mechanism.modes[:2]:
            found, size = seen.full(q, mode.name)["compliance"], 1e-3
            moved = []
            for axis in "xy":
                held = [joint[name] for name in mode.motors]
                bent = pf.statics(model, loads={f"{at}.{axis}": size}, torques={}, held=held, steps=1, buckling=0,
                                  start=start, warning=False, stiffness=[f"{at}.x", f"{at}.y"])  # fmt: skip
                moved.append([np.diff(bent.place(f"{at}.{one}"))[0] / size for one in "xy"])
            assert np.linalg.eigvalsh(moved)[::-1] == pytest.approx(found["sizes"], rel=1e-2)

    def test_a_link_with_another_mesh_has_numbers_at_once(self):
        text = library_text("five_bar")
        model, q = read(text)
        before = Seeing(model)
        before.full(q, "")
        changed, q = read(text.replace("elements = 3", "elements = 4", 1))
        assert Seeing(changed, before).full(q, "")["held"] == pytest.approx(
            Seeing(changed).full(q, "")["held"], rel=1e-9
        )

    def test_compliance_as_differences_of_statics(self):
        model, q = read(library_text("five_bar"))
        found = Seeing(model).full(q, "")["compliance"]
        differences = [
            [pf.statics(model, loads={f"distal1.C.{axis}": size}, steps=1, buckling=0,
                        stiffness=["distal1.C.x", "distal1.C.y"]) for size in (0.01, -0.01)]
            for axis in "xy"
        ]  # fmt: skip
        matrix = [[(plus.travel(f"distal1.C.{axis}")[-1] - minus.travel(f"distal1.C.{axis}")[-1]) / 0.02
                   for axis in "xy"] for plus, minus in differences]  # fmt: skip
        sizes, axes = np.linalg.eigh(np.array(matrix))
        assert found["sizes"] == pytest.approx(sizes[::-1], rel=1e-4)
        assert math.tan(found["angle"]) == pytest.approx(axes[1, 1] / axes[0, 1], rel=1e-2)


class TestForces:
    """A force dragged on a point."""

    def test_cantilever_bends_and_buckles(self):
        model, q = read(CANTILEVER)
        found = drag_force(model, q, "beam.T", [0.0, 2.0])
        assert found["deflection"][1] == pytest.approx(2.0 * LENGTH**3 / (3.0 * EI), rel=1e-3)
        assert found["stiffness"] == pytest.approx(3.0 * EI / LENGTH**3, rel=1e-3)
        assert found["place"][1] == pytest.approx(found["deflection"][1], abs=1e-12)
        (name, line, plate), base = found["bodies"][0], found["base"][0]
        assert (name, plate, len(line)) == ("beam", False, len(base))
        assert line[-1] == pytest.approx(found["place"], abs=1e-8)
        assert base[-1] == pytest.approx([LENGTH, 0.0], abs=1e-8)
        pressed = drag_force(model, q, "beam.T", [-10.0, 0.0])
        assert pressed["buckling"] == pytest.approx(np.pi**2 * EI / (4.0 * LENGTH**2) / 10.0, rel=1e-2)
        # A straight beam loses stiffness in proportion to the force: both linear estimates are the same.
        assert pressed["buckling_note"].startswith("linear estimate, which changes along the branch: ")
        assert float(pressed["buckling_note"].split()[-7]) == pytest.approx(pressed["buckling"], rel=1e-2)
        free = drag_force(model, q, "beam.T", [10.0, 0.0])
        assert (free["buckling"], free["buckling_note"]) == (None, "")

    def test_as_of_statics(self):
        model, q = read(library_text("five_bar"))
        found = drag_force(model, q, "distal1.C", [1.0, -2.0], buckling=False)
        other = pf.statics(model, loads={"distal1.C.x": 1.0, "distal1.C.y": -2.0}, steps=7)
        expected = [other.travel(f"distal1.C.{axis}")[-1] for axis in "xy"]
        assert found["deflection"] == pytest.approx(expected, rel=1e-6)
        assert found["stiffness"] == pytest.approx(5.0 / (expected[0] - 2.0 * expected[1]), rel=1e-6)

    def test_weight_alone(self):
        model, q = read(f"gravity = [0.0, {-G}]\n" + CANTILEVER)
        found = drag_force(model, q, "beam.T", [])
        load = 7850 * 0.02 * 0.004 * G
        assert found["place"][1] == pytest.approx(-load * LENGTH**4 / (8.0 * EI), rel=1e-3)
        assert found["deflection"] == [0.0, 0.0]
        assert found["stiffness"] is found["buckling"] is None

    def test_drive_is_held(self):
        model, q = read(library_text("four_bar"))
        found = drag_force(model, q, "coupler.A", [0.0, -5.0])
        assert abs(found["deflection"][1]) < 1e-3

    def test_what_snaps_through_is_reported(self):
        model, q = read(library_text("five_bar"))
        found = drag_force(model, q, "distal1.C", [0.0, -40.0])
        assert found["findings"][0] == f"it snaps through at {found['buckling']:.3g} of the force"
        assert found["buckling_note"] == "limit point"
        # A force of 5/8 of the limit finds the same one beyond it.
        beyond = drag_force(model, q, "distal1.C", [0.0, -6.25])
        assert beyond["buckling_note"] == "limit point beyond this force"
        assert 6.25 * beyond["buckling"] == pytest.approx(40.0 * found["buckling"], rel=1e-5)

    @pytest.mark.parametrize(("text", "ref", "problem"), [
        (CANTILEVER, "beam.nowhere", "neither a joint nor"),
        (library_text("pendulum"), "beam.{}", "do not hold"),
        (library_text("slider_crank"), "slider.{}", "no link is flexible"),
    ])  # fmt: skip
    def test_refusals(self, text, ref, problem):
        model, q = read(text)
        points = model.mechanism.body(ref.partition(".")[0]).points
        with pytest.raises(InputError, match=problem) as refused:
            drag_force(model, q, ref.format(*points), [1.0, 0.0])
        assert "\n" not in str(refused.value)


class TestLinear:
    """Poles and responses."""

    def test_oscillator(self):
        damper = '[damper.oil]\njoint = "A"\ncoefficient = 0.2\n'
        text = ARM.replace(f"{-G}]", "0.0]") + SPRING + damper
        found = linear(*read(text), "")
        inertia = 0.01 + 2.0 * 0.3**2
        omega, ratio = math.sqrt(3.0 / inertia), 0.2 / (2.0 * math.sqrt(3.0 * inertia))
        (pole,) = found["poles"]
        assert pole[2:] == pytest.approx([omega / (2.0 * np.pi), ratio], rel=1e-9)
        assert pole[:2] == pytest.approx([-ratio * omega, omega * math.sqrt(1.0 - ratio**2)], rel=1e-9)
        assert (found["input"], [one["output"] for one in found["responses"]]) == ("shoulder", ["x", "y"])
        vertical = found["responses"][1]
        s = 2j * np.pi * np.array(found["frequency"])
        expected = 0.5 * math.cos(0.4) / (inertia * s**2 + 0.2 * s + 3.0)
        assert vertical["unit"] == "m/(N m)"
        assert vertical["magnitude"] == pytest.approx(20.0 * np.log10(np.abs(expected)), abs=1e-6)
        assert vertical["phase"] == pytest.approx(np.degrees(np.angle(expected)), abs=1e-6)

    def test_force_on_a_flexure(self):
        found = linear(*read(library_text("leaf_spring_guide")), "")
        assert found["input"] == "stage.T.x"
        (along,) = found["responses"]
        # The static stiffness, raised by the resonance at 11.37 Hz, of which the lowest frequency is a fifth.
        static = 20.0 * math.log10(0.0009524762 / (1.0 - 0.2**2))
        assert along["magnitude"][0] == pytest.approx(static, abs=0.01)
        assert (along["output"], along["unit"]) == ("x", "m/N")

    def test_drive_stands_still(self):
        model, q = read(library_text("four_bar"))
        found = linear(model, q, "")
        assert found["held"][0] == pytest.approx(Seeing(model).full(q, "")["held"][0], rel=1e-6)

    @pytest.mark.parametrize("name", ["five_bar", "3prr", "raparm_i"])
    def test_held_are_the_motors_of_the_mode(self, name):
        model, q = read(library_text(name))
        seen, motors, firsts = Seeing(model), model.mechanism.motors, {}
        for one in ["", *(each.name for each in model.mechanism.modes)]:
            held = seen.full(q, one)["held"]
            found = linear(model, q, one)["held"]
            assert found[: len(held)] == pytest.approx(held, rel=1e-6)
            holding = next((each.motors for each in model.mechanism.modes if each.name == one), motors)
            firsts[len(holding)] = max(held[0], firsts.get(len(holding), 0.0))
        # The more motors hold, the stiffer it is.
        assert [firsts[count] for count in sorted(firsts)] == sorted(firsts.values())

    def test_nothing_excites_a_pendulum(self):
        with pytest.raises(InputError, match="nothing excites it"):
            linear(*read(library_text("pendulum")), "")


LINKS = """
[body.{0}]
points = {{ {1} = [0.0, 0.0], {2} = [{3}, 0.0] }}
"""
# What a person adds from the empty sheet to a five-bar that runs, and the sentence after each step.
STEPS = [
    ("", "Draw a link", "link"),
    ("\n[ground]\nA = [-0.1, 0.0]\nE = [0.1, 0.0]\n", "Draw a link", "link"),
    (LINKS.format("a", "A", "B", 0.25), "Join the links", "link"),
    ('\n[joint]\nA = ["ground.A", "a.A"]\n\n[assembly.drawn]\na = 2.16\n',
     "Choose what moves it: a motor, or the crank", "drive"),
    (LINKS.format("b", "B", "C", 0.25) + '\n[joint.B]\ntype = "revolute"\npoints = ["a.B", "b.B"]\n',
     "Choose what moves it: 2 motors", "motor"),
    (LINKS.format("c", "E", "D", 0.25) + LINKS.format("d", "D", "C", 0.25)
     + '\n[joint.E]\ntype = "revolute"\npoints = ["ground.E", "c.E"]\n'
     + '\n[joint.D]\ntype = "revolute"\npoints = ["c.D", "d.D"]\n'
     + '\n[joint.C]\ntype = "revolute"\npoints = ["b.C", "d.C"]\n', "Choose what moves it: 2 motors", "motor"),
    ('\n[motor]\nleft = "A"\n', "It can be moved by hand; for a run, a needs a mass", ""),
    ("masses", "No end-effector", "effector"),
    ('\n[end_effector]\npoint = "b.C"\ncoordinates = ["x", "y"]\n', "No path", "path"),
    ('\n[path.up]\ntype = "line"\nstart = [0.0, 0.3]\nend = [0.0, 0.6]\nmax_acceleration = 10.0\n',
     "Path up leaves the reach", "path"),
    ("shorter", "No actuation mode", "motor"),
    ('\n[mode]\none = ["left"]\n', "Mode one drives 1 of 2", "motor"),
    ("second", "Ready: run mode one on path up", "run"),
]  # fmt: skip
POSES = {"b = 0.25": "body.b", "c = 0.98": "body.c", "d = 2.89": "body.d"}


def grown(text, step):
    """The text after a step."""
    if step == "masses":
        return text.replace("points = { ", "mass = 0.2\ninertia = 1e-3\ncentre_of_mass = [0.12, 0.0]\npoints = { ")
    if step == "shorter":
        return text.replace("end = [0.0, 0.6]", "end = [0.0, 0.4]")
    if step == "second":
        return text.replace('left = "A"', 'left = "A"\nright = "E"').replace('["left"]', '["left", "right"]')
    text += step
    for line, body in POSES.items():
        if f"[{body}]" in step:
            text = text.replace("a = 2.16\n", f"a = 2.16\n{line}\n")
    return text


@pytest.fixture
def session(tmp_path):
    """A session with the empty sheet."""
    session = EditSession(Document(drafts=tmp_path), lambda _: None)
    yield session
    session.close()


def ready(session, text):
    """The sentence and the tool that a text leads to."""
    state = session.answer({"id": 1, "do": "text", "text": text})["ok"]
    seen = state["seen"] or {}
    return (
        state["ready"] if seen.get("path", []) is not None else session.answer({"id": 2, "do": "reach"})["ok"]["ready"]
    )


class TestReadiness:
    """One sentence on what stands in the way of a run."""

    def test_from_the_empty_sheet_to_a_run(self, session):
        text = 'name = "untitled"\n'
        for step, sentence, action in STEPS:
            text = grown(text, step)
            found = ready(session, text)
            assert (found["sentence"][: len(sentence)], found["action"]) == (sentence, action), text
            assert found["ok"] == sentence.startswith("Ready")
        assert session.answer({"id": 2, "do": "check"})["ok"]["ok"]

    @pytest.mark.parametrize("name", library_names())
    def test_library_mechanisms_are_ready(self, session, name):
        found = ready(session, library_text(name))
        flexure = name in ("leaf_spring_guide", "cross_spring_pivot", "folded_beam_guide")
        assert (found["ok"], found["action"]) == (True, "pull" if flexure else "run")
        assert found["sentence"].startswith("Ready: pull" if flexure else "Ready: run")
        assert session.answer({"id": 2, "do": "check"})["ok"]["ok"]

    def test_a_flexure_without_statics_is_pulled(self, session):
        assert ready(session, CANTILEVER)["sentence"] == "Ready: pull at beam.T to bend it"

    def test_a_crank_without_masses_can_be_turned(self, session):
        text = ARM.replace('[motor]\nshoulder = "A"', '[prescribed.crank]\njoint = "A"\nspeed = 2.0')
        text = text.replace("mass = 2.0\ninertia = 0.01\n", "")
        found = ready(session, text)
        assert found["sentence"] == "It can be moved by its drive; for a run, upper needs a mass"
        assert found["place"] == ["body", "upper", "mass"]

    def test_what_is_rigid_cannot_move(self, session):
        joint = 'A = ["ground.A", "upper.A"]'
        weld = joint.replace("[joint]", "").replace("A = ", "points = ")
        text = ARM.replace(f"[joint]\n{joint}", f'[joint.A]\ntype = "weld"\n{weld}\nangle = 0.4')
        assert ready(session, text.replace('[motor]\nshoulder = "A"', ""))["sentence"].startswith("It cannot move")

    def test_open_loops_and_errors_come_first(self, session):
        found = ready(session, library_text("five_bar").replace("l1 = 0.250", "l1 = 0.050"))
        assert not found["ok"]
        found = ready(session, library_text("five_bar").replace("width = 0.030", "width = -0.030"))
        assert (found["ok"], found["place"]) == (False, ["section", "bar", "width"])

    def test_a_wrong_run_is_not_let_pass(self):
        text = library_text("five_bar")
        found = checked(read(text.replace("[[0.040, 0.370]", "[[0.040, 0.570]"))[0])
        assert (found["ok"], found["place"]) == (False, ["path", "square"])
        assert "out of reach" in found["sentence"]
        found = checked(read(text.replace("max_acceleration = 40.0", "max_acceleration = 40000.0"))[0])
        assert found["ok"]
        assert "path-fast" in found["findings"][0]


class TestMessages:
    """Requests of the page."""

    def test_force_and_linear_model(self, session):
        ready(session, library_text("leaf_spring_guide"))
        force = {"id": 1, "do": "force", "ref": "stage.T", "force": [1.0, 0.0]}
        found = session.answer(force)["ok"]
        assert found["buckling"] is not None
        assert session.answer(force | {"buckling": False})["ok"]["deflection"] == pytest.approx(found["deflection"])
        assert session.answer(force | {"force": []})["ok"]["stiffness"] is None
        assert "error" in session.answer(force | {"ref": "stage.none"})
        assert session.answer({"id": 2, "do": "linear"})["ok"]["poles"][0][2] == pytest.approx(11.3666, rel=1e-3)
