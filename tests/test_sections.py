"""Sections by shape: closed forms against integrals over the section, checks, files, sweeps and derivatives."""

import math
from dataclasses import replace
from typing import get_args

import numpy as np
import pytest

import paraflex as pf
from paraflex.designs.sweep import load_sweep
from paraflex.files import load_data, model_from
from paraflex.files.schema import SectionTable
from paraflex.mechanism import Rectangle, Round, Section, Tube
from paraflex.mechanism.sections import SHAPES


def integrals(chord, half):
    """Area and second moment of area of a section by Simpson's rule over chords; y = half sin(u) keeps it smooth."""
    u = np.linspace(-math.pi / 2, math.pi / 2, 4001)
    weights = np.ones(u.size)
    weights[1:-1:2], weights[2:-1:2] = 4.0, 2.0
    y, dy = half * np.sin(u), half * np.cos(u)
    weights *= (u[1] - u[0]) / 3.0 * dy
    width = chord(y)
    return weights @ width, weights @ (width * y**2)


def circle(diameter):
    return lambda y: 2.0 * np.sqrt(np.maximum(0.0, diameter**2 / 4 - y**2))


@pytest.mark.parametrize(
    ("section", "shapes"),
    [
        (Section.rectangle(0.04, 0.006), [(1.0, lambda y: 0.04 + 0 * y, 0.003)]),
        (Section.rectangle(0.04, 0.02, 0.002),
         [(1.0, lambda y: 0.04 + 0 * y, 0.01), (-1.0, lambda y: 0.036 + 0 * y, 0.008)]),
        (Section.round(0.01), [(1.0, circle(0.01), 0.005)]),
        (Section.tube(0.02, 0.0015), [(1.0, circle(0.02), 0.01), (-1.0, circle(0.017), 0.0085)]),
    ],
)  # fmt: skip
def test_areas_and_second_moments_are_integrals(section, shapes):
    area, second_moment = sum(sign * np.array(integrals(chord, half)) for sign, chord, half in shapes)
    assert section.area == pytest.approx(area, rel=1e-9)
    assert section.second_moment == pytest.approx(second_moment, rel=1e-9)
    assert section.outer_fibre == shapes[0][2]


def test_a_tube_without_a_hole_is_round():
    full, solid = Section.tube(0.02, 0.00999999999), Section.round(0.02)
    assert full.area == pytest.approx(solid.area, rel=1e-12)
    assert full.second_moment == pytest.approx(solid.second_moment, rel=1e-12)


def test_numbers_that_make_no_section_are_refused():
    for make, says in [
        (lambda: Section.tube(0.02, 0.01), r"section.wall: as thick as half of the section, 0.01 m, or thicker"),
        (lambda: Section.rectangle(0.04, 0.01, 0.005), r"section.wall: as thick"),
        (lambda: Section.tube(0.02, 0.0), r"section.wall: must be positive"),
        (lambda: Section.round(-0.02), r"section.diameter: must be positive"),
        (lambda: Section.rectangle(0.0, 0.01), r"section.width: must be positive"),
    ]:
        with pytest.raises(pf.InputError, match=says):
            make()


def with_bar(**table):
    data, source = load_data("five_bar")
    data["section"]["bar"] = table
    return model_from(data, source)


@pytest.mark.parametrize(
    ("table", "shape"),
    [
        ({"width": 0.03, "thickness": 0.005}, Rectangle(0.03, 0.005)),
        ({"shape": "rectangle", "width": "30 mm", "thickness": 0.005}, Rectangle(0.03, 0.005)),
        ({"width": 0.03, "thickness": 0.01, "wall": "1 mm"}, Rectangle(0.03, 0.01, 0.001)),
        ({"shape": "round", "diameter": "12 mm"}, Round(0.012)),
        ({"shape": "tube", "diameter": "12 mm", "wall": "1 mm"}, Tube(0.012, 0.001)),
    ],
)
def test_a_file_has_sections_by_shape_and_says_them_again(table, shape, tmp_path):
    model = with_bar(**table)
    assert model.mechanism.body("distal1").section == Section.of(shape)
    model.mechanism.save(tmp_path / "new.toml")
    assert pf.load(tmp_path / "new.toml").mechanism == model.mechanism
    # Another shape in the place of the file's.
    for other in (Section.tube(0.01, 0.002), Section.rectangle(0.02, 0.01), Section(1e-4, 1e-9, None, 0.005)):
        bodies = [replace(body, section=other) for body in model.mechanism.bodies]
        replace(model, mechanism=model.mechanism.with_bodies(bodies)).save(tmp_path / "other.toml")
        assert {body.section for body in pf.load(tmp_path / "other.toml").mechanism.bodies} == {other}


@pytest.mark.parametrize(
    ("table", "says"),
    [
        ({"diameter": 0.01}, r'section.bar.shape: is missing; write "round" or "tube"'),
        ({"shape": "round"}, r"section.bar.diameter: is missing; give the outer diameter in m"),
        ({"shape": "round", "diameter": 0.01, "wall": 0.001}, r"section.bar.wall: a round section has no wall"),
        ({"shape": "tube", "diameter": 0.01, "wall": 0.005}, r"section.bar.wall: as thick as half"),
        ({"shape": "ring", "diameter": 0.01}, r"section.bar.shape: should be 'rectangle'"),
        ({"width": 0.01}, r"section.bar.thickness: is missing"),
        ({"area": 1e-4, "second_moment": 1e-9, "width": 0.01}, r"section.bar.width: a section by its area has no"),
        ({"area": 1e-4}, r"section.bar.second_moment: is missing"),
        ({"shape": "tube", "diameter": "12 kg", "wall": 0.001}, r"section.bar.diameter: a quantity in kg where one"),
    ],
)  # fmt: skip
def test_tables_that_make_no_section_are_refused(table, says):
    with pytest.raises(pf.InputError, match=f"^five_bar.toml: {says}"):
        with_bar(**table)


STUDY = """
mechanism = "arm.toml"
metrics = ["rms_torque_norm", "deflection_max"]
duration = "50 ms"
samples = 21
[integration]
tolerance = "1 nm"
[vary.diameter]
fields = ["section1.diameter"]
"""


def test_diameters_are_varied_and_differentiated(tmp_path, monkeypatch):
    model = with_bar(shape="tube", diameter=0.012, wall=0.001)
    model.mechanism.save(tmp_path / "arm.toml")
    text = (tmp_path / "arm.toml").read_text()
    lines = ["[path.way]", 'type = "line"', "start = [0.0, 0.33]", "end = [0.02, 0.33]", "max_acceleration = 8.0"]
    (tmp_path / "arm.toml").write_text(text + "\n" + "\n".join(lines) + "\n")
    monkeypatch.chdir(tmp_path)
    (tmp_path / "slopes.toml").write_text(STUDY)
    (tmp_path / "sweep.toml").write_text(STUDY + 'low = "11.98 mm"\nhigh = "1.202 cm"\nnumber = 3\n')
    slopes = pf.sensitivities("slopes.toml")
    runs = load_sweep("sweep.toml").run("runs").data
    assert runs["diameter"].values == pytest.approx([0.01198, 0.012, 0.01202], rel=1e-12)
    for name, slope in zip(slopes.metrics, slopes.derivatives[0], strict=True):
        low, _, high = runs[name].values
        assert slope[0] == pytest.approx((high - low) / 4e-5, rel=1e-2)
    (tmp_path / "wrong.toml").write_text(STUDY + 'low = "4 kg"\nhigh = 0.01\nnumber = 3\n')
    with pytest.raises(pf.InputError, match=r"vary.diameter.low: a quantity in kg where one in m"):
        load_sweep("wrong.toml")
    (tmp_path / "values.toml").write_text(STUDY + 'values = ["12 mm", 0.011]\n')
    assert load_sweep("values.toml").designs[:, 0].tolist() == [0.012, 0.011]
    (tmp_path / "values.toml").write_text(STUDY + 'values = ["12 deg", 0.011]\n')
    with pytest.raises(pf.InputError, match=r"vary.diameter.values: a quantity in rad where one in m"):
        load_sweep("values.toml")


def test_the_schema_has_all_shapes():
    named, _ = get_args(SectionTable.model_fields["shape"].annotation)
    assert get_args(named) == tuple(SHAPES)
