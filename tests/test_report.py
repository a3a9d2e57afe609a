"""The report's file: it holds the dataset's numbers, breaks on no name, loads nothing, and says what failed."""

import base64
import json
import re
import shlex
import zlib
from pathlib import Path

import numpy as np
import pytest
import xarray as xr

from paraflex import formatting
from paraflex.errors import InputError, OutputError
from paraflex.figures.charts import Axis, Panel
from paraflex.formatting import display_units, number as format_number, text_symbol as symbol, typeset
from paraflex.plots.catalogue import CATALOGUE
from paraflex.reports import Page, animation, motion_page, render, save_page, tracking_page, verification_page
from paraflex.reports.designs import PARALLEL, DesignChart
from paraflex.reports.film import MOST_FRAMES, frames_of
from paraflex.reports.packing import Series, packed
from paraflex.reports.page import plotly_script
from paraflex.results import load_results, open_results
from reports import FAILED, MODES, STOPPED, array_of, chart_of, html_of, rows_of, told, tracked, verified
from shell import paraflex
from test_cli import FAST

OLD = Path(__file__).parent / "data" / "schema1.nc"
DOUBT = {
    "code": "stress-over-strength", "level": "doubtful", "place": "mode +-+-", "text": "a stress", "remedy": "a remedy",
}  # fmt: skip
AWKWARD = "α <script>alert(\"1\")</script> & 'two' </title> $x \u2028"


@pytest.fixture(scope="module")
def tracking_html():
    return html_of(tracking_page(tracked(), FAILED))


@pytest.fixture(scope="module")
def page(tracking_html):
    return told(tracking_html)


def text_of(html):
    """What is read: tags as spaces."""
    return re.sub(r"\s+", " ", re.sub(r"<[^>]+>", " ", html))


def test_the_mechanism_comes_before_tables_and_the_solver_after_them():
    html = html_of(tracking_page(tracked().assign_attrs(findings="[]"), FAILED))
    marks = ('class="verdict partly failed"', 'class="tiles"', 'id="moving"', "<h2>Modes</h2>", "<h2>Integration</h2>",
             '<dl class="facts">')  # fmt: skip
    places = [html.index(mark) for mark in marks]
    assert places == sorted(places)
    linked = re.findall(r'<a href="#([^"]+)">', html[: places[1]])
    assert len(linked) > 3
    assert all(f'id="{anchor}"' in html for anchor in linked)


def test_many_notices_are_folded_and_all_there():
    notes = ["one", "two", "three"]
    few, many = (html_of(Page("a", "run", notes=notes[:k])) for k in (2, 3))
    assert "<details>" not in few
    assert "<summary>2 more notices</summary>" in many
    assert all(f'<p class="notice">{note}</p>' in many for note in notes)


def test_what_is_only_rounding_is_printed_as_zero():
    number = formatting.number
    assert number(1e-17, factor=1e3, beside=0.3) == number(-1e-17, factor=1e3, beside=0.3) == "0"
    assert typeset(number(1e-12, factor=1e3, beside=0.3, digits=3, padded=True)) == "1.00 × 10⁻⁹"
    assert number(1e-17) == number(1e-17, beside=np.nan) == "1e-17"
    data = tracked().copy(deep=True)
    data["energy_balance_max"][:] = 3e-18
    data["tracking_rms_motion"][0] = data["tracking_rms"][0] = 2e-17
    html = html_of(tracking_page(data))
    assert "10⁻¹⁸" not in html
    assert re.search(r'class="pick">\+\+\+\+</button></th><td class="words">complete</td><td>0</td>', html)


def test_charts_are_titled_by_what_they_plot():
    """A distance from singular positions would fall to zero there; a condition number grows."""
    page = tracking_page(tracked())
    charts = {chart.identity: chart for panel in page.panels for chart in panel.charts}
    condition = charts["condition"]
    assert condition.title == "Condition number of the actuation matrix"
    assert (condition.y.name, condition.y.unit) == ("condition number", "1")
    first = tracked()["actuation_condition"].values[0]
    assert np.nanmax(condition.curves[0].y) == pytest.approx(np.nanmax(first))
    # Not deflections, which are from the chord: so are the table's and the tile's.
    assert "deflection" not in charts["deflections"].title + charts["deflections"].y.name
    assert "tangent at its first end" in charts["deflections"].note
    singular = next(one for one in CATALOGUE["tracking"] if one.name == "actuation_condition")
    assert singular.shows == "condition number of the actuation matrix along the path, all modes"


def test_rows_come_back_rounded_by_less_than_a_hundred_thousandth_and_once_each():
    rng = np.random.default_rng(3)
    values = rng.normal(size=300) * 10.0 ** rng.uniform(-9, 9, 300)
    values[[0, 7]] = np.nan
    series = Series()
    assert [series.add(values), series.add([1.0]), series.add(values)] == [0, 1, 0]
    kept, one = rows_of(series.to_dict())
    np.testing.assert_allclose(kept, values, rtol=5e-6)
    assert one.tolist() == [1.0]
    assert series.add([np.inf, 1e300]) == 2


def test_time_is_told_as_exactly_as_single_precision_has_it(page):
    time = rows_of(page["series"])[page["time"]]
    assert time.tolist() == tracked()["time"].values.astype(np.float32).tolist()


def test_arrays_come_back_within_half_a_step_with_their_gaps():
    rng = np.random.default_rng(4)
    values = np.cumsum(rng.normal(size=(2, 60, 5, 2)), axis=1) + [3.0, -40.0]
    values[1, 30:] = np.nan
    smooth = np.sin(np.linspace(0.0, 3.0, 60))[:, None, None] * values[:, :1]
    along = np.linspace(0.0, 1.0, 5)[:, None] * values[:, :, :1]
    assert [packed(one)["orders"] for one in (values, smooth, along)] == [(1, 0), (3, 1), (1, 2)]
    np.testing.assert_allclose(array_of(packed(smooth)), smooth, rtol=0, atol=0.51 * np.ptp(smooth) / 65534)
    back = array_of(packed(values))
    assert np.array_equal(np.isnan(back), np.isnan(values))
    span = np.ptp(values[np.isfinite(values).all(axis=-1)], axis=0).max()
    assert np.nanmax(np.abs(back - values)) <= 0.51 * span / 65534
    assert array_of(packed(np.full((1, 3, 2, 2), 7.0))).tolist() == np.full((1, 3, 2, 2), 7.0).tolist()


def test_the_film_is_the_shapes_of_the_dataset_also_magnified(page):
    shown, data = page["film"], tracked()
    base, bend = array_of(shown["base"]), array_of(shown["bend"])
    shape, stiff = (data[name].values.astype(float) for name in ("shape", "shape_base"))
    extent = np.nanmax(shape) - np.nanmin(shape)
    assert np.array_equal(np.isnan(base), np.isnan(stiff))
    # Magnified two hundred times the deflections are still finer than a pixel of a thousand.
    for times in (1.0, 200.0):
        exact = stiff + times * (shape - stiff)
        assert np.nanmax(np.abs(base + times * bend - exact)) < 1e-3 * extent
    assert [body[0] for body in shown["bodies"]] == [f"link{k}" for k in range(1, 9)]
    assert shown["bodies"][-1][2] == data.sizes["station"]
    still, _ = shown["marks"][0]
    assert sum(look == "ground" for look, *_ in still["pieces"]) == 4
    np.testing.assert_allclose((base + bend)[0, :, shown["tips"][0][0]], data["end_effector"].values[0], atol=1e-5)
    np.testing.assert_allclose(array_of(shown["path"])[0], data["end_effector_desired"].values[0], atol=1e-5)


def test_a_long_run_is_thinned_to_its_first_and_last_frame():
    kept = frames_of(12345)
    assert kept.size == MOST_FRAMES
    assert (kept[0], kept[-1]) == (0, 12344)
    assert np.ptp(np.diff(kept)) <= 1
    assert frames_of(20).tolist() == list(range(20))


def test_curves_are_the_values_of_the_dataset(page):
    data, rows = tracked(), rows_of(page["series"])
    alone = [curve for curve in chart_of(page, "torques")["curves"] if curve["choice"] == 0]
    for curve in alone:
        motor = [symbol(str(name)) for name in data["motor"].values].index(curve["name"])
        assert curve["shown"] == [curve["run"]]
        np.testing.assert_allclose(rows[curve["y"]], data["torque"].values[curve["run"], :, motor], rtol=5e-6)
    assert len(alone) == len(MODES) * data.sizes["motor"]
    # All modes beside each other share the rows of those alone.
    beside = [curve for curve in chart_of(page, "torques")["curves"] if curve["choice"] == 1]
    assert [curve["name"] for curve in beside] == [f"mode {mode}" for mode in MODES]
    assert {curve["y"] for curve in beside} <= {curve["y"] for curve in alone}
    chart = chart_of(page, "errors")
    far = np.linalg.norm(data["end_effector"].values - data["end_effector_desired"].values, axis=-1)
    assert chart["y"] == ["distance [mm]"]
    for curve in chart["curves"]:
        shown, whole = rows[curve["y"]], 1e3 * far[curve["run"]]
        # On the logarithmic axis without the rise from zero.
        from_here = int(np.argmax(np.isfinite(shown)))
        assert 0 < from_here < 10
        assert whole[from_here] >= 0.01 * np.nanmedian(whole) > whole[from_here - 1]
        np.testing.assert_allclose(shown[from_here:], whole[from_here:], rtol=1e-5)
    assert np.isnan(rows[chart["curves"][2]["y"]][26:]).all()


def test_no_two_curves_seen_together_look_alike(page):
    for panel in page["panels"]:
        for chart in panel["charts"]:
            for run in range(len(MODES)):
                for choice in range(max(1, len(chart["choices"]))):
                    seen = [
                        (curve["colour"], curve["dash"])
                        for curve in chart["curves"]
                        if (curve["shown"] is None or run in curve["shown"]) and curve["choice"] in (None, choice)
                        # The mark at the start of a curve has its look.
                        if "mark" not in curve
                    ]
                    assert len(set(seen)) == len(seen), chart["identity"]


def test_the_table_has_the_numbers_of_the_dataset(tracking_html):
    data, text = tracked(), text_of(tracking_html)
    for k in (0, 1):
        row = text[text.index(f" {MODES[k]} complete ") :]
        cells = row.split()[2:]
        assert cells[0] == format_number(float(data["tracking_rms"][k]), factor=1e6)
        gaps = np.linalg.norm(data["end_effector"][k] - data["end_effector_desired"][k], axis=-1)
        # Each column has a unit for all modes.
        assert cells[1] in {format_number(float(gaps.max()), factor=factor) for factor in (1e3, 1e6)}
        assert cells[2] == format_number(float(data["peak_torque"][k, 0]))
        assert cells[3] == format_number(float(data["rms_torque"][k, 0]))
    assert f"<td>{int(data['newton_iterations'][0])}</td>" in tracking_html


def test_modes_that_failed_say_why(tracking_html):
    text = text_of(tracking_html)
    assert f" {STOPPED} failed " in text
    marks = ("partly failed", f"Mode {STOPPED}: failed.", "failed 1 of 3 modes from t = 0.05 s on")
    places = [text.index(mark) for mark in marks]
    assert places == sorted(places)
    assert f"Mode {STOPPED}: failed. the run has not ended after 20 steps, at t = 0.05 s" in text
    assert " +--- failed " in text
    assert "Mode +--- could not be run: mode &quot;+---&quot; cannot drive the mechanism: 1 active" in text


def test_a_run_that_failed_says_so_before_all_else():
    data = tracked().isel(mode=[2]).assign_attrs(findings=json.dumps([DOUBT]))
    data["validity"] = data["validity"] * 0.0 + 0.1
    html = html_of(tracking_page(data))
    text = text_of(html)
    text = text[text.index("verdict:") :]
    reason = f"Mode {STOPPED}: failed. the run has not ended after 20 steps, at t = 0.05 s."
    assert text.startswith("verdict: failed ")
    assert text.index(reason) < text.index("warning: mode +-+-: a stress")
    assert " failed at 0.05 s mode " in text
    assert "<span>peak torque</span>" not in html
    assert "validity:" not in text


def test_nothing_is_loaded_from_anywhere(tracking_html):
    assert "default-src 'none'" in tracking_html
    for tag in re.findall(r"<(?:script|link|img|iframe|object|embed)[^>]*>", tracking_html):
        assert "src=" not in tag
        assert "http" not in tag
    assert "@import" not in tracking_html
    assert re.search(r"url\(|fetch\(|XMLHttpRequest|import\(", tracking_html) is None


def test_plotly_comes_compressed_and_whole_only_where_its_basic_part_does_not_do():
    basic, whole = (zlib.decompress(base64.b64decode(plotly_script(whole=each))).decode() for each in (False, True))
    assert basic.startswith("/**\n* plotly.js (basic - minified) v")
    assert "parcoords" in whole
    assert all("MIT license" in script[:300] for script in (basic, whole))
    assert len(plotly_script(whole=False)) < 600_000 < len(plotly_script(whole=True)) < 2_200_000
    designs = Panel("All designs", [DesignChart(PARALLEL, "All", Axis("y"), x=Axis("x"), drawer=PARALLEL)])
    for survey in ((), (designs,)):
        assert plotly_script(whole=bool(survey)) in render(Page("a", "test", survey=survey))


def test_a_report_of_three_short_runs_takes_less_than_a_megabyte():
    assert len(render(tracking_page(tracked()))) < 1_000_000


def test_shapes_of_bent_beams_take_less_than_half_a_byte_for_each_number():
    along, time = np.linspace(0.0, 1.0, 17), np.linspace(0.0, 1.0, 200)
    shape = np.sin(7.0 * time)[:, None] * along**2 * (3.0 - along)
    values = np.stack([np.broadcast_to(along, shape.shape), 1e-3 * shape], axis=-1)[None]
    kept = packed(values)
    assert len(kept["data"]) < 0.5 * values.size
    np.testing.assert_allclose(array_of(kept), values, rtol=0, atol=0.51 / 65534)


def test_names_cannot_break_out_of_the_page():
    bodies = np.array([AWKWARD, "link2"])
    data = tracked().isel(body=[0, 1]).assign_coords(body=bodies)
    data = data.assign_coords(mode=[AWKWARD, "b", "c"])
    data.attrs = data.attrs | {"mechanism": AWKWARD, "parameters": json.dumps({"run": {"path": AWKWARD}})}
    html = html_of(tracking_page(data, {AWKWARD: AWKWARD}))
    assert "<script>alert" not in html
    assert html.count("</title>") == 1
    assert html.count("<script") == html.count("</script>") == 4
    kept = told(html)
    assert kept["runs"][0] == AWKWARD
    assert AWKWARD in {curve["name"] for curve in chart_of(kept, "deflections")["curves"]}
    assert "α &lt;script&gt;" in html
    assert "\u2028" not in html[html.index("report-data") :]


def test_an_old_file_has_a_report_that_says_why_nothing_moves():
    data = open_results(OLD)
    assert "shape" not in data
    page = tracking_page(data)
    assert page.film is None
    assert "earlier version" in page.no_film
    html = html_of(page)
    assert page.no_film in html
    assert told(html)["film"] is None


def test_one_mode_has_no_choice_of_modes():
    page = told(html_of(tracking_page(tracked().isel(mode=[1]))))
    assert page["runs"] == [MODES[1]]
    assert page["selected"] == 0
    beside = [curve["choice"] for curve in chart_of(page, "torques")["curves"] if curve["choice"]]
    assert len(beside) == len(set(beside))


def test_runs_without_a_single_sample_still_have_a_report():
    data = tracked().isel(mode=[2]).copy(deep=True)
    for name in data.data_vars:
        if "time" in data[name].dims:
            data[name][:] = np.nan
    page = told(html_of(tracking_page(data)))
    assert np.isnan(array_of(page["film"]["base"])).all()
    assert page["film"]["view"] == [-1.0, -1.0, 1.0, 1.0] or np.isfinite(page["film"]["view"]).all()


def test_a_verification_tells_distances_and_overlays_models():
    data, figures = verified()
    html = html_of(verification_page(data, figures))
    page, text = told(html), text_of(html)
    assert page["runs"] == ["rigid", "linear geometry", "finite segments"]
    mode = figures["modes"]["++++"]

    def is_in_text(value: float, unit: str, digits: int) -> bool:
        shown = (typeset(formatting.number(value, digits, factor=one.factor)) for one in display_units(unit))
        return any(one in text for one in shown)

    for name in ("rigid", "linear"):
        assert is_in_text(mode["models"][name]["distance_max"], "m", 4)
        assert is_in_text(mode["models"][name]["angle_difference_rms"]["link3"], "rad", 3)
        assert is_in_text(mode["models"][name]["angular_velocity_difference_rms"]["link3"], "rad/s", 3)
    assert "[rad/s]" in text
    assert "kineto-elastodynamics" not in text
    assert is_in_text(mode["distances"]["rigid"]["linear"], "m", 3)
    rows, chart = rows_of(page["series"]), chart_of(page, "angle_differences")
    reference = list(data["model"].values).index(data.attrs["reference"])
    assert chart["choices"][2] == "link3"
    drawn = [curve for curve in chart["curves"] if curve["choice"] == 2]
    apart = data["chord_angle"].values[:, 0, :, 2] - data["chord_angle"].values[reference, 0, :, 2]
    factor = np.nanmax(np.abs(rows[drawn[0]["y"]])) / np.abs(apart[0]).max()
    assert factor == pytest.approx(10.0 ** round(np.log10(factor)), rel=1e-5)
    for k, curve in enumerate(drawn):
        # Pages keep five digits.
        np.testing.assert_allclose(rows[curve["y"]], factor * apart[k], rtol=2e-5, atol=1e-12)
    assert array_of(page["film"]["base"]).shape[0] == 3


def test_a_models_failure_is_told():
    data, figures = verified()
    broken = json.loads(json.dumps(figures))
    broken["modes"]["++++"]["models"]["mujoco"] = {"status": "failed", "message": "base: diverges <here>"}
    html = html_of(verification_page(data, broken))
    assert "MuJoCo: base: diverges &lt;here&gt;" in html
    assert "not all complete" in html


@pytest.mark.parametrize(
    ("values", "unit"),
    [
        ([4.8e-7, 2.1e-2], "µm"),
        ([2.3e-5, 4.6e-2], "mm"),
        ([0.0, None, 3e-18, 0.2], "mm"),
        ([1e-12, 1.0], "mm"),
        ([], "mm"),
    ],
)  # fmt: skip
def test_one_unit_in_which_no_value_needs_a_power_of_ten(values, unit):
    assert formatting.common_unit("m", values, beside=1.0).name == unit


def test_numbers_and_names_as_print_has_them():
    numbers = (0.0, 0.377_4, 12.345, 9_876.5, -1.2e-5, None, float("nan"))
    assert [typeset(formatting.number(x, 3, padded=True)) for x in numbers] == [
        "0", "0.377", "12.3", "9876", "−1.20 × 10⁻⁵", "–", "–",
    ]  # fmt: skip
    assert [symbol(name) for name in ("tau1", "A2", "link10", "α<b>")] == ["τ₁", "A₂", "link10", "α<b>"]
    assert typeset(formatting.count(43708.0)) == "43\u2009708"


def test_a_page_appears_whole_or_not_at_all(tmp_path):
    (tmp_path / "file").write_text("in the way")
    with pytest.raises(OutputError, match="cannot be written"):
        save_page(Page("a", "test"), tmp_path / "file" / "report.html")
    assert [entry.name for entry in tmp_path.iterdir()] == ["file"]


def test_without_plotly_it_is_said(monkeypatch):
    monkeypatch.setattr("paraflex.reports.page.find_spec", lambda name: None)
    plotly_script.cache_clear()
    assert "report-data" in render(Page("a", "test"))
    with pytest.raises(InputError, match="plotly: not installed"):
        plotly_script(whole=True)
    monkeypatch.undo()
    plotly_script.cache_clear()


# --- The command line ---------------------------------------------------------------------------------------------


@pytest.fixture(scope="module")
def ran(tmp_path_factory):
    out = tmp_path_factory.mktemp("ran")
    done = paraflex("run", "raparm_i", "--no-figures", "--mode", "++++", "--mode", "tau1", *FAST, "--out", str(out))
    return done, out


def test_a_run_writes_its_report_with_modes_that_could_not_start(ran):
    done, out = ran
    assert done.returncode == 1
    html = (out / "report.html").read_text(encoding="utf-8")
    assert "<title>RAParM-I – paraflex run</title>" in html
    assert "Mode +--- could not be run" in html
    assert "report.html in" in done.stderr


def test_the_report_is_written_again_the_same(ran, tmp_path):
    _, out = ran
    before = (out / "report.html").read_bytes()
    refused = paraflex("report", str(out))
    assert refused.returncode == 2
    assert "already exists; give --force to overwrite it" in refused.stderr
    assert paraflex("report", str(out), "--output", str(tmp_path / "again.html")).returncode == 0
    assert (tmp_path / "again.html").read_bytes() == before
    (out / "report.html").write_text("old")
    assert paraflex("report", str(out / "results.nc"), "--force").returncode == 0
    assert (out / "report.html").read_bytes() == before


def test_the_command_in_the_report_gives_the_results_again(ran, tmp_path):
    _, out = ran
    html = (out / "report.html").read_text(encoding="utf-8")
    command = text_of(re.search(r'<p class="command"><code>(.*?)</code>', html).group(1))
    words = shlex.split(command)
    assert words[:2] == ["paraflex", "run"]
    again = paraflex(*words[1:], "--no-report", "--no-figures", "--out", str(tmp_path))
    assert again.returncode == 1, again.stderr
    assert not (tmp_path / "report.html").exists()
    first, second = load_results(out / "results.nc"), load_results(tmp_path / "results.nc")
    xr.testing.assert_identical(first.drop_vars("wall_time"), second.drop_vars("wall_time"))


def test_a_run_without_a_path_has_a_report(tmp_path):
    own = ("-m", "pendulum", "--duration", "0.2", "--samples", "41")
    done = paraflex("run", "--no-figures", *own, "--out", str(tmp_path))
    assert done.returncode == 0, done.stderr
    html = (tmp_path / "report.html").read_text(encoding="utf-8")
    assert "<h1>flexible pendulum</h1>" in html
    data = open_results(tmp_path)
    page = told(html)
    rows = rows_of(page["series"])
    force = [curve for curve in chart_of(page, "forces")["curves"] if curve["name"] == "magnitude"]
    np.testing.assert_allclose(
        rows[force[0]["y"]], np.linalg.norm(data["joint_force"].values[:, 0], axis=-1), rtol=1e-5
    )
    assert {"angles", "rates", "deflections", "energies", "coordinates", "points"} <= {
        chart["identity"] for panel in page["panels"] for chart in panel["charts"]
    }
    # The bob has no joint: its trail is drawn.
    shown = page["film"]
    np.testing.assert_allclose(
        (array_of(shown["base"]) + array_of(shown["bend"]))[0, :, shown["tips"][0][0]],
        data["point_position"].sel(point="beam.tip"),
        atol=1e-4,
    )
    assert motion_page(data).film is not None
    tile = next(value for title, value, _ in motion_page(data).figures if title == "largest deflection")
    unit = tile.partition(" ")[2]
    assert float(tile.split()[0]) == pytest.approx(
        {"mm": 1e3, "µm": 1e6}[unit] * float(data["deflection"].max()), rel=0.01
    )
    assert animation(data.drop_vars("shape"), ()) is None


def test_what_is_drawn_is_left_out_where_they_are_not_wanted(tmp_path):
    """Those of the results before, which have other numbers, go with them."""
    command = ("run", "pendulum", "--samples", "11", "--out", tmp_path / "out")
    for duration, options, kept in (
        ("0.1", (), {"figures", "report.html"}),
        ("0.11", ("--no-figures",), {"report.html"}),
        ("0.12", ("--no-figures", "--no-report"), set()),
    ):
        done = paraflex(*command, "--duration", duration, *options)
        assert done.returncode == 0, done.stderr
        assert {name for name in ("figures", "report.html") if (tmp_path / "out" / name).exists()} == kept
        named = {name for name in ("figures", "report.html") if name in done.stderr.splitlines()[-1]}
        assert named == kept


def test_verify_has_a_report(tmp_path):
    done = paraflex("verify", "--model", "rigid", "--model", "linear", "--duration", "0.02", "--samples", "11",
                    "--tol", "1e-4", "--out", str(tmp_path))  # fmt: skip
    assert done.returncode == 0, done.stderr
    before = (tmp_path / "report.html").read_bytes()
    assert b"paraflex verify" in before
    assert paraflex("report", str(tmp_path), "--force").returncode == 0
    assert (tmp_path / "report.html").read_bytes() == before


@pytest.mark.parametrize("what", ["nothing", "sweep", "foreign"])
def test_what_is_no_result_is_refused(tmp_path, what):
    if what == "sweep":
        (tmp_path / "results.parquet").write_bytes(b"")
    if what == "foreign":
        (tmp_path / "results.nc").write_bytes(b"no netCDF")
    done = paraflex("report", str(tmp_path / "none" if what == "nothing" else tmp_path))
    assert done.returncode == 2
    assert done.stderr.startswith("error: ")
    assert done.stderr.count("\n") == 1
