"""RAParM-II, 3-RRR and 4-RRR in other engines: exact beams and second-order geometry, MuJoCo and our segments."""

import numpy as np
import pytest

from paraflex.files import load
from paraflex.mechanism import Geometry
from paraflex.studies.agreement import Refinement
from paraflex.studies.verification import VerificationOptions, run_model
from paraflex.tracking import plan_tracking

OPTIONS = VerificationOptions(tolerance=5e-7)


@pytest.fixture(scope="module")
def records():
    """Runs of the first 0.1 s of a mechanism's study, each made once."""
    tasks, runs = {}, {}

    def run(name, mode, model):
        if name not in tasks:
            found = load(name)
            tasks[name] = plan_tracking(found.mechanism, found.path(), duration=0.1, samples=51)
        key = (name, mode, model)
        if key not in runs:
            runs[key] = run_model(tasks[name], tasks[name].mode(mode), model, Refinement.NONE, OPTIONS)
        return runs[key]

    return run


def apart(a, b):
    return np.max(np.linalg.norm(a.end_effector.position - b.end_effector.position, axis=1))


def turned_apart(a, b):
    """Largest difference of the platform's angle."""
    return np.max(np.abs(a.links["angle"][:, -1] - b.links["angle"][:, -1]))


# Motors at base, at base and elbows, redundant and not; a rigid platform that several loops close at.
CASES = [("3rrr", "+++---"), ("3rrr", "++-+--"), ("3rrr", "++++++"), ("4rrr", "++++"), ("4rrr", "-+++"),
         ("raparm_ii", "++++"), ("raparm_ii", "+-+-")]  # fmt: skip


@pytest.mark.parametrize(("name", "mode"), CASES)
def test_exact_beams_confirm_second_order_geometry(records, name, mode):
    """Links bend the end-effector off by 13 to 98 um in this time; both programs' steps and meshes cost 1 um."""
    exact, ours, rigid = (records(name, mode, model) for model in ("exudyn", "second-order", "rigid"))
    assert apart(ours, rigid) > 1e-5
    assert apart(exact, ours) < 1.2e-6
    assert apart(exact, ours) < 0.03 * apart(ours, rigid)
    # The linear shape is further off, by a factor of eight or more.
    assert apart(exact, records(name, mode, Geometry.LINEAR.value)) > 8.0 * apart(exact, ours)


@pytest.mark.parametrize(("name", "mode"), CASES)
def test_mujoco_confirms_our_segments(records, name, mode):
    """One model, two programs: a hundredth of the deflection at most, mostly our own tolerance of 0.5 um."""
    theirs, ours, rigid = (records(name, mode, model) for model in ("mujoco", "segments", "rigid"))
    assert apart(theirs, ours) < 1.5e-7
    assert apart(theirs, ours) < 0.01 * apart(ours, rigid)
    assert theirs.figures["constraint_position_max"] < 1e-8


@pytest.mark.parametrize(("name", "mode"), [case for case in CASES if case[0] != "raparm_ii"])
def test_platforms_turn_alike(records, name, mode):
    exact, ours, rigid = (records(name, mode, model) for model in ("exudyn", "second-order", "rigid"))
    assert turned_apart(ours, rigid) > 2e-5
    assert turned_apart(exact, ours) < 0.04 * turned_apart(ours, rigid)
    assert turned_apart(*(records(name, mode, model) for model in ("mujoco", "segments"))) < 2e-7
