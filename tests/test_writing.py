"""Files and folders that are written whole or not at all, and plans that take the rest from the study."""

from dataclasses import replace

import numpy as np
import pytest

from paraflex import load
from paraflex.errors import InputError, OutputError
from paraflex.files import StudyDefaults
from paraflex.mechanism import Start
from paraflex.tracking import plan_tracking
from paraflex.writing import read_json, whole_file, whole_folder, write_json, write_text


class Half(Exception):
    """Of whoever writes."""


def half(whole, name, error):
    with whole as unfinished:
        (unfinished / name).write_text("half")
        raise error


@pytest.mark.parametrize("error", [Half, KeyboardInterrupt])
def test_a_file_that_is_not_finished_leaves_what_was_there(tmp_path, error):
    file = tmp_path / "new" / "figures.json"
    write_json(file, {"value": 1.0})
    with pytest.raises(error):
        half(whole_file(file), "", error)
    assert read_json(file) == {"value": 1.0}
    assert list(file.parent.iterdir()) == [file]


def test_a_folder_replaces_the_files_of_its_kind(tmp_path):
    folder = tmp_path / "frames"
    for texts in (["1", "2", "3"], ["4"]):
        with whole_folder(folder, replaced="frame_*.png") as unfinished:
            for number, text in enumerate(texts):
                (unfinished / f"frame_{number}.png").write_text(text)
        (folder / "notes.txt").write_text("mine")
    assert sorted(each.name for each in folder.iterdir()) == ["frame_0.png", "notes.txt"]
    assert (folder / "frame_0.png").read_text() == "4"
    with pytest.raises(Half):
        half(whole_folder(folder, replaced="*"), "frame_0.png", Half)
    assert (folder / "frame_0.png").read_text() == "4"
    assert list(tmp_path.iterdir()) == [folder]


def test_a_place_that_cannot_be_written_is_named_with_what_to_do(tmp_path):
    (tmp_path / "file").write_text("in the way")
    with pytest.raises(OutputError, match=r"^--out: cannot be written \([a-z ]+\); do without$"):
        write_text(tmp_path / "file" / "x.txt", "", field="--out", remedy="do without")


def test_a_plan_takes_what_is_not_given_from_the_study():
    model = load("raparm_i")
    task = model.plan()
    whole = plan_tracking(model.mechanism, model.path("square"), duration=0.7, samples=701)
    np.testing.assert_array_equal(task.motion.q, whole.motion.q)
    assert task.after.value == model.study.after
    asked = model.plan(model.path("line"), mechanism=model.mechanism.rigid(), duration=0.2, samples=5, after="hold")
    np.testing.assert_allclose(asked.motion.t, [0.0, 0.05, 0.1, 0.15, 0.2], rtol=1e-15)
    assert (asked.path, asked.after.value, asked.system.n_flexible) == (model.path("line"), "hold", 0)
    with pytest.raises(InputError, match=r"raparm_i.toml: start: a path says where and how the mechanism starts"):
        replace(model, start=Start()).plan()


def test_a_step_of_the_study_goes_with_its_method():
    study = StudyDefaults(method="esdirk3", tolerance=1e-6, step=1e-3)
    assert study.integration().step == 1e-3
    other = study.integration({"method": "radau", "tolerance": None})
    assert (other.method.name, other.tolerance, other.step) == ("radau", 1e-6, None)
    assert study.filled(samples=5, assembly=None) == replace(study, samples=5)
