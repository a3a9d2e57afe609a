"""Assertions are recorded with the part of the tolerance that they use, and reported if rounding may fail them."""

import json
import shutil
import subprocess
import sys
from pathlib import Path

import pytest

import any_processor
import processes
from any_processor import Run, excesses

MADE_UP = """
import numpy as np
import pytest
from numpy.testing import assert_allclose

def test_made_up():
    assert 0.1 < abs(-0.3) < 0.4
    assert {"a": 1.0} == pytest.approx({"a": 1.004}, abs=0.01)
    assert np.array([1.0, 2.0]) == pytest.approx(np.array([1.001, 2.009]), abs=0.01)
    assert_allclose([1.0, 2.0], [1.002, 2.0], rtol=0.0, atol=0.01)
    for k in range(2):
        assert all(each < 3 for each in (0, k))
    assert not 3.0 < 2.0
    assert_allclose([np.nan, np.inf, 1.0], [np.nan, np.inf, 1.0])
    assert np.nan == pytest.approx(np.nan, nan_ok=True)
    assert 1.0 != pytest.approx(2.0)
"""


def test_every_assertion_is_recorded_with_its_line(tmp_path):
    shutil.copy(any_processor.TESTS / "margins.py", tmp_path)
    (tmp_path / "test_made_up.py").write_text(MADE_UP)
    command = ("-m", "pytest", "-p", "margins", "--rootdir", tmp_path, tmp_path / "test_made_up.py")
    environment = {"MARGINS": str(tmp_path / "records"), "PYTHONPATH": str(tmp_path)}
    processes.python(*command, cwd=tmp_path, env=environment, check=True)
    (record,) = map(json.loads, (tmp_path / "records").read_text().splitlines())
    lines = {number: f"test_made_up.py:{number}" for number in (7, 8, 9, 10, 12)}
    assert record["test"] == "test_made_up.py::test_made_up"
    used = {lines[8]: 0.4, lines[9]: 0.9, lines[10]: 0.2, "test_made_up.py:14": 0.0}
    assert record["used"] == pytest.approx(used, rel=1e-9)
    assert record["sides"] == {lines[7]: [[0.1, 0.3], [0.3, 0.4]], lines[12]: [[0, 3], [0, 3], [0, 3], [1, 3]]}


@pytest.mark.parametrize(
    ("used", "reported"),
    [((0.2, 0.3), False), ((0.9, 0.9), False), ((0.9, 0.9005), False), ((0.9, 0.902), True), ((0.3, 0.4), True)],
)
def test_equality_is_reported_if_rounding_moves_it_beyond_a_third(used, reported):
    runs = [Run(used={("test", "place"): part}) for part in used]
    assert excesses(runs) == ({("test", "place"): max(used)} if reported else {})


@pytest.mark.parametrize(
    ("sides", "reported"),
    [
        # A limit that rounding leaves alone, one that it moves too far; errors of rounding far and near.
        (([(0.94, 1.0)], [(0.945, 1.0)]), False),
        (([(0.94, 1.0)], [(0.95, 1.0)]), True),
        (([(1e-14, 1e-12)], [(3e-13, 1e-12)]), False),
        (([(4e-13, 1e-12)], [(3e-13, 1e-12)]), True),
        # In a loop, which is longer under one setting; signs.
        (([(0.9, 1.0), (1.0, 1.01)], [(0.9, 1.0)]), False),
        (([(0.0, 1.0), (0.9, 1.0)], [(0.0, 1.0), (0.8, 1.0)]), True),
        (([(-1.0, -0.9)], [(-1.1, -0.9)]), True),
        (([(-1.0, -0.1)], [(-2.0, -0.1)]), False),
        (([(-0.1, 0.1)], [(-0.2, 0.1)]), True),
    ],
)
def test_inequality_is_reported_if_near_and_its_spread_exceeds_a_tenth_of_its_distance(sides, reported):
    found = excesses([Run(sides={("test", "place"): each}) for each in sides])
    assert list(found) == ([("test", "place")] if reported else [])


def test_outcomes_are_counted_and_named(tmp_path):
    records, results = any_processor.files_of("as it is", tmp_path)
    assert Path(records).parent == tmp_path
    records.write_text('{"test": "t::a", "used": {"t.py:1": 0.5}, "sides": {"t.py:2": [[0.0, 1.0]]}}\n')
    cases = '<testcase classname="t" name="a"/><testcase classname="t" name="b"><failure/></testcase>'
    results.write_text(f'<testsuite>{cases}<testcase classname="t" name="c"><skipped/></testcase></testsuite>')
    run = any_processor.read_run("as it is", tmp_path)
    assert (run.passed, run.failed) == (1, ["t::b"])
    other = Run(passed=2, used={("t::a", "t.py:1"): 0.2})
    printed = any_processor.table({"as it is": run, "BLAS Haswell": other})
    assert "| as it is | 1 | 1 | 2 | 1 | 0.50 |" in printed
    assert "| BLAS Haswell | 2 | 0 | 1 | 0 | 0.20 |" in printed
    assert "Failed under as it is: t::b" in printed
    assert "- 0.5 used, t.py:1, t::a" in printed


def test_every_setting_has_its_turn(monkeypatch):
    class Answer:
        def __init__(self, number):
            self.stdout = f"{number:040x}\n"

    found = []
    others = list(any_processor.SETTINGS)[1:]
    monkeypatch.setattr(any_processor.Path, "read_text", lambda _: "flags: sse2 avx512f")
    for number in range(len(others)):
        monkeypatch.setattr(any_processor.subprocess, "run", lambda *_, number=number, **__: Answer(number))
        found.append(any_processor.setting_of_commit())
    assert found == others
    monkeypatch.setattr(any_processor.Path, "read_text", lambda _: "flags: sse2")
    for number in range(len(others)):
        monkeypatch.setattr(any_processor.subprocess, "run", lambda *_, number=number, **__: Answer(number))
        assert "SkylakeX" not in any_processor.setting_of_commit()


def test_the_setting_of_a_commit_is_printed_for_the_environment():
    done = subprocess.run(
        [sys.executable, any_processor.__file__, "--by-commit"], capture_output=True, text=True, check=True
    )
    name, _, value = done.stdout.strip().partition("=")
    assert {name: value} in any_processor.SETTINGS.values()
