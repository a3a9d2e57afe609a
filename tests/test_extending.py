"""What the page on extending says is done in a copy of the package, and gives what the page says."""

import re
import shutil
import sys
from pathlib import Path

import paraflex
import processes
from pages import Block, apply_diff, blocks_of, check_output

# The first line of a definition by name, what modules begin with, or the line between two additions.
DEFINED = re.compile(r" +(?:class |def |\w+(?:: .*)? = ).*[([{:]$| from __future__ |@@$")
PAGE = Path(__file__).parents[1] / "docs" / "extending.md"


def test_all_seven_kinds_of_additions_are_made_as_the_page_says(tmp_path):
    # With the compiled kernels, which do not change.
    package = Path(shutil.copytree(Path(paraflex.__file__).parent, tmp_path / "paraflex"))
    printed, ran = "", 0
    for block in blocks_of(PAGE):
        file = package / block.title if block.title else None
        if block.language == "diff":
            assert file is not None
            # Neighbours would go astray with the next name that is added.
            assert all(DEFINED.match(line) for line in block.text.splitlines() if line[0] != "+")
            apply_diff(file, block.text)
        elif file is not None:
            assert not file.exists()
            file.write_text(block.text, encoding="utf-8")
        elif block.language == "text":
            check_output(block.text, printed)
        else:
            printed, ran = run(block, tmp_path), ran + 1
    assert ran == 14


OWN_FIELD = """
from dataclasses import dataclass, field

from paraflex.mechanism import Joint
from paraflex.mechanism.quantities import positive, said


@dataclass(frozen=True)
class BushJoint(Joint, kind="bush", holds=("points",)):
    width: float = field(metadata=said("the width in mm", positive, "mm"))


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
    assert run(Block("python", "", OWN_FIELD, ""), tmp_path, Path(paraflex.__file__).parents[1]).splitlines() == [
        "BushJoint 2.0 pin",
        "own.toml: joint.NAME.width: is missing; give the width in mm",
        "own.toml: joint.NAME.width: must be positive (got -1.0); give it in mm",
        "own.toml: joint.NAME.angle: a bush joint has no angle (got 1.0); leave it out",
        "own.toml: joint.NAME.width: a weld joint has no width (got 2.0); leave it out",
        "the width in mm",
    ]


def run(block, folder, package=None):
    """What a block prints, run by a Python that finds the copy in a folder, or the package, first."""
    if block.language == "python":
        commands = [[sys.executable, "-c", block.text]]
    else:
        assert block.language == "sh", block
        commands = [[sys.executable, "-m", *line.split()] for line in block.text.splitlines()]
    environment = {"PYTHONPATH": str(package or folder), "COLUMNS": "80"}
    printed = ""
    for command in commands:
        printed += processes.run(*command, cwd=folder, env=environment, check=True).stdout
    return printed
