"""What the page on extending says is done in a copy of the package, and gives what the page says."""

import json
import re
import shutil
import sys
from pathlib import Path

import paraflex
import processes
from pages import Block, apply_diff, blocks_of, check_output

# The first line of a definition by name, or the line between two additions.
DEFINED = re.compile(r" +(?:class |def |\w+(?:: .*)? = ).*[([{:]$| # \w+$|@@$")
PAGE = Path(__file__).parents[1] / "docs" / "extending.md"


def test_all_ten_kinds_of_additions_are_made_as_the_page_says(tmp_path):
    # With the compiled kernels, which do not change.
    package = Path(shutil.copytree(Path(paraflex.__file__).parent, tmp_path / "paraflex"))
    ran, waiting = 0, []
    for block in blocks_of(PAGE):
        file = package / block.title if block.title else None
        if file is None:
            waiting.append(block)
            continue
        # Blocks between two edits run in one process, those after an edit in one that sees it.
        ran, waiting = ran + check(waiting, tmp_path), []
        if block.language == "diff":
            # Neighbours would go astray with the next name that is added.
            assert all(DEFINED.match(line) for line in block.text.splitlines() if line[0] != "+")
            apply_diff(file, block.text)
        else:
            assert not file.exists()
            file.write_text(block.text, encoding="utf-8")
    assert ran + check(waiting, tmp_path) == 20


def check(blocks, folder):
    """Run blocks, hold what each prints against the text below it; how many were run."""
    runs = [block for block in blocks if block.language != "text"]
    printed, last = iter(run(runs, folder)), None
    for block in blocks:
        if block.language == "text":
            check_output(block.text, last)
        else:
            last = next(printed)
    return len(runs)


OWN_FIELD = """
from dataclasses import dataclass, field

from paraflex.mechanism import Joint
from paraflex.mechanism.quantities import field_metadata, positive


@dataclass(frozen=True)
class BushJoint(Joint, kind="bush", holds=("points",)):
    width: float = field(metadata=field_metadata("the width in mm", positive, "mm"))


import paraflex as pf
from paraflex.files import load_data, model_from
from paraflex.files.schema import model_schema

data = load_data("pendulum")[0]
(name, points), = data["joint"].items()
for given in ({"width": 2.0}, {}, {"width": -1.0}, {"width": 2.0, "angle": 1.0}, {"type": "weld", "width": 2.0}):
    data["joint"][name] = {"type": "bush", "points": points} | given
    try:
        joint = model_from(data, "own.toml").mechanism.joints[0]
        print(type(joint).__name__, joint.width, joint.symbol)
    except pf.InputError as error:
        print(str(error).replace(name, "NAME"))
print(model_schema()["$defs"]["JointTable"]["properties"]["width"]["description"])
"""


def test_a_joint_with_a_field_of_its_own_is_read_and_checked_by_what_the_field_says(tmp_path):
    (printed,) = run([Block("python", "", OWN_FIELD, "")], tmp_path, Path(paraflex.__file__).parents[1])
    assert printed.splitlines() == [
        "BushJoint 2.0 pin",
        "own.toml: joint.NAME.width: is missing; give the width in mm",
        "own.toml: joint.NAME.width: must be positive (got -1.0); give it in mm",
        "own.toml: joint.NAME.angle: a bush joint has no angle (got 1.0); leave it out",
        "own.toml: joint.NAME.width: a weld joint has no width (got 2.0); leave it out",
        "the width in mm",
    ]


OWN_LAW = """
from collections.abc import Mapping
from dataclasses import dataclass

import numpy as np

from paraflex.control.laws.law import Law, StartedLaw, given
from paraflex.mechanism.quantities import positive


class Relay(StartedLaw):
    def __init__(self, torque):
        self.torque = torque

    def step(self, state, k, t, y):
        return -self.torque * np.sign(y), (state or 0) + 1


@dataclass(frozen=True)
class RelayLaw(Law, kind="relay", title="relay"):
    torque: float | Mapping[str, float] = given("the torque in N m, of all motors or by motor", positive, "N m",
                                                by="motors")

    def start(self, plant):
        values = self.torque if isinstance(self.torque, Mapping) else dict.fromkeys(plant.outputs, self.torque)
        return Relay(np.array([values[name] for name in plant.outputs]))


import paraflex as pf
from paraflex.files import load_data, model_from

data = load_data("five_bar")[0]
for torque in ({"left": 0.1, "right": 0.2}, -1.0, {"lift": 0.1}, "0.1 N", {"left": 0.0}, {"left": np.nan}):
    data["controller"] = {"relay": {"type": "relay", "torque": torque, "period": 1e-3}}
    try:
        model = model_from(data, "own.toml")
        run = pf.Simulation(model, mode="left", duration=0.01, samples=11, start="outward").run(
            model.controllers["relay"], warning=False)
        print(run.controllers[0].law, run.controllers[0].outputs, len(run.controllers[0].t))
    except pf.InputError as error:
        print(error)


@dataclass(frozen=True)
class NoLaw(Law, kind="none", title="none"):
    def start(self, plant):
        return None


law = pf.SampledController(NoLaw(), period=1e-3, outputs=["left"])
try:
    pf.Simulation(pf.load("five_bar"), mode="left", duration=0.01, samples=11, start="outward").run(law, warning=False)
except pf.ParaflexError as error:
    print(error)
"""


def test_a_law_with_a_state_of_its_own_is_read_and_checked_by_what_its_fields_say(tmp_path):
    (printed,) = run([Block("python", "", OWN_LAW, "")], tmp_path, Path(paraflex.__file__).parents[1])
    assert printed.splitlines() == [
        "relay ('left',) 10",
        "own.toml: controller.relay.torque: must be positive (got -1.0); give it in N m",
        "own.toml: controller.relay.torque: unknown motor (got 'lift'); did you mean \"left\"?",
        "own.toml: controller.relay.torque: a quantity in N where one in N m is asked for (got '0.1 N'); give the "
        "torque in N m, of all motors or by motor",
        "own.toml: controller.relay.torque.left: must be positive (got 0.0); give it in N m",
        "own.toml: controller.relay.torque.left: should be a finite number (got nan); give the torque in N m, of all "
        "motors or by motor",
        'controller "controller" raised TypeError: its `start` returned NoneType, not a LinearLaw or another '
        "StartedLaw at t = 0 s (step 0); correct the controller",
    ]


# Each Python block has names of its own, each line of a shell block ends with exit code 0.
RUN = """
import contextlib, io, json, sys
from pathlib import Path
from paraflex.cli.app import main

printed = []
for language, text in json.loads(Path("blocks.json").read_text(encoding="utf-8")):
    with contextlib.redirect_stdout(io.StringIO()) as out:
        if language == "python":
            exec(compile(text, "extending.md", "exec"), {"__name__": "__main__"})
        for line in text.splitlines() if language == "sh" else ():
            sys.argv = line.split()
            try:
                main()
            except SystemExit as end:
                assert not end.code, (line, end.code)
    printed.append(out.getvalue())
Path("printed.json").write_text(json.dumps(printed), encoding="utf-8")
"""


def run(blocks, folder, package=None):
    """What blocks print, run by one Python that finds the copy in a folder, or the package, first."""
    if not blocks:
        return []
    assert {block.language for block in blocks} <= {"python", "sh"}
    (folder / "blocks.json").write_text(json.dumps([(block.language, block.text) for block in blocks]))
    environment = {"PYTHONPATH": str(package or folder), "COLUMNS": "80"}
    processes.run(sys.executable, "-c", RUN, cwd=folder, env=environment, check=True)
    return json.loads((folder / "printed.json").read_text(encoding="utf-8"))
