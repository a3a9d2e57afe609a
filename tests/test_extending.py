"""What the page on extending says is done in a copy of the package, and gives what the page says."""

import os
import re
import shutil
import subprocess
import sys
from pathlib import Path

import paraflex
from pages import apply_diff, blocks_of, check_output

# The first line of a definition by name, or the line between two additions.
DEFINED = re.compile(r" (?:class |def |\w+(?:: .*)? = ).*[([{:]$|@@$")
PAGE = Path(__file__).parents[1] / "docs" / "extending.md"


def test_a_mechanism_a_scheme_a_metric_a_family_of_studies_and_a_joint_are_added_as_the_page_says(tmp_path):
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
    assert ran == 9


def run(block, folder):
    """What a block prints, run by a Python that finds the copy first."""
    if block.language == "python":
        commands = [[sys.executable, "-c", block.text]]
    else:
        assert block.language == "sh", block
        commands = [[sys.executable, "-m", *line.split()] for line in block.text.splitlines()]
    environment = {**os.environ, "PYTHONPATH": str(folder), "COLUMNS": "80"}
    printed = ""
    for command in commands:
        done = subprocess.run(command, capture_output=True, text=True, check=False, cwd=folder, env=environment)
        assert done.returncode == 0, done.stderr
        printed += done.stdout
    return printed
