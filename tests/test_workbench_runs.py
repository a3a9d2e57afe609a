"""Runs of the workbench: superseded, cancelled, killed, and equal to those of the package; what a person takes away."""

import base64
import json
import os
import signal
import sys
import zlib
from contextlib import contextmanager

import numpy as np
import psutil
import pytest

import paraflex as pf
from paraflex.errors import InputError
from paraflex.limits import FILE_BYTES
from paraflex.workbench import leaving
from paraflex.workbench.computing import computed, model_of
from paraflex.workbench.runs import Runner
from paraflex.workbench.shown import shown
from paraflex.workbench.worker import answer
from processes import WITHIN, started, wait_until

FIVE_BAR, PENDULUM = pf.library.text("five_bar"), pf.library.text("pendulum")
# It would take hours.
ENDLESS = PENDULUM.replace("duration = 2.0", "duration = 100000.0")
OWNER = """
import sys, time
from paraflex.workbench.runs import Runner

if __name__ == "__main__":
    runner = Runner()
    runner.start({"text": open(sys.argv[1]).read(), "preview": False}, lambda event: print(event["state"], flush=True))
    time.sleep(600)
"""


class Heard(list):
    """Events of a run."""

    def last(self, *states):
        """Wait for an event with one of these states."""
        return wait_until(lambda: next((one for one in self if one["state"] in states), None), what=f"one of {states}")


@pytest.fixture(scope="module")
def runner():
    with Runner() as made:
        yield made


def run(runner, text, **more):
    heard = Heard()
    runner.start({"text": text, "preview": False, **more}, heard.append)
    return heard


def finished(runner, text, **more):
    return run(runner, text, **more).last("done", "error")


def test_a_run_is_that_of_the_package(runner):
    event = finished(runner, FIVE_BAR)
    data = pf.run_study(pf.load("five_bar").plan(), ["++"]).data
    (row,) = event["numbers"]
    assert (event["event"], event["modes"], row["mode"], row["status"]) == ("run", ["++"], "++", "complete")
    assert row["error_rms"] == pytest.approx(data["tracking_rms_motion"].item(), rel=1e-9)
    assert row["error_max"] == pytest.approx(data["tracking_max_motion"].item(), rel=1e-9)
    assert row["peak_torque"]["left"] == pytest.approx(float(abs(data["torque"].sel(motor="left")).max()), rel=1e-9)
    assert row["stress_max"] == pytest.approx(float(data["stress_max"].max()), rel=1e-9)
    assert row["safety_factor"] is None
    assert event["accuracy"] == {"coarse": False, "tolerance": 1e-5, "samples": 601}
    assert json.loads(json.dumps(event, allow_nan=False)) == json.loads(json.dumps(event))


def test_the_page_has_film_charts_and_stresses(runner):
    event = finished(runner, FIVE_BAR)
    film, data = event["page"]["film"], computed(model_of(FIVE_BAR)).result.data
    assert len(film["time"]) == 181
    assert film["base"]["shape"] == film["bend"]["shape"] == [1, 181, 68, 2]
    assert [one[0] for one in film["bodies"]] == ["proximal1", "distal1", "proximal2", "distal2"]
    charts = [chart["identity"] for panel in event["page"]["panels"] for chart in panel["charts"]]
    assert len(charts) > 5
    assert event["page"]["runs"] == ["++"]
    stress = event["stress"]
    steps = np.frombuffer(zlib.decompress(base64.b64decode(stress["data"])), dtype=np.uint8).reshape(stress["shape"])
    # Stations begin and end at sections; a frame is the nearest of 601 samples, a byte the nearest of 254 steps.
    frame, first = 90, data["section_body"].values.tolist().index("distal1")
    sample = int(np.argmin(abs(data["time"].values - film["time"][frame])))
    expected = abs(data["section_moment"][0, sample, first] / data["section_modulus"][first]) + abs(
        data["section_force"][0, sample, first] / data["section_area"][first]
    )
    station = film["bodies"][1][1]
    assert steps[0, frame, station] * stress["most"] / 254 == pytest.approx(float(expected), abs=stress["most"] / 200)
    assert steps.max() == 254


def test_a_model_without_a_path_runs_by_itself(runner):
    event = finished(runner, PENDULUM)
    run = pf.simulate_motion(pf.load("pendulum"), samples=401)
    expected = float(pf.motion_dataset(run)["stress_max"].max())
    assert event["modes"] == [""]
    assert event["numbers"][0]["error_rms"] is None
    assert event["numbers"][0]["stress_max"] == pytest.approx(expected, rel=1e-9)


def test_only_the_modes_asked_for_run(runner):
    event = finished(runner, pf.library.text("geared_five_bar"), modes=["+-"])
    assert event["modes"] == ["+-"]


def test_files_of_the_model_are_found_in_its_folder(runner, tmp_path):
    (tmp_path / "push.csv").write_text("t [s],torque [N m]\n0,0\n1,0\n2,0\n", encoding="utf-8")
    load = '[load.push]\ntype = "torque"\npoint = "beam.O"\ntable = "push.csv"\n\n[study]'
    text = PENDULUM.replace("[study]", load)
    there = finished(runner, text, folder=str(tmp_path))
    elsewhere = finished(runner, text, folder=str(tmp_path / "no"), source="p.toml")
    assert there["state"] == "done", there["text"]
    assert elsewhere["state"] == "error"
    assert elsewhere["text"].startswith("p.toml: load.push")


def test_a_first_look_is_coarse_and_marked_so():
    events = []
    answer({"text": FIVE_BAR}, events.append, lambda: False, only_coarse=True)
    event = events[-1]
    assert event["state"] == "preview"
    assert event["accuracy"] == {"coarse": True, "tolerance": 2.5e-4, "samples": 121}
    whole = shown(computed(model_of(FIVE_BAR)))
    assert event["numbers"][0]["stress_max"] == pytest.approx(whole["numbers"][0]["stress_max"], rel=0.1)
    assert event["numbers"][0]["peak_torque"]["left"] == pytest.approx(
        whole["numbers"][0]["peak_torque"]["left"], rel=0.05
    )


def test_a_second_start_supersedes_the_first(runner):
    first = run(runner, ENDLESS)
    first.last("running")
    second = run(runner, FIVE_BAR)
    assert second.last("done", "error")["state"] == "done"
    count = len(first)
    assert {one["state"] for one in first} == {"running"}
    assert len({one["run"] for one in [*first, *second]}) == 2
    assert finished(runner, PENDULUM)["state"] == "done"
    assert len(first) == count


def test_many_starts_end_with_the_last(runner):
    heard = [run(runner, text) for text in [ENDLESS, FIVE_BAR, PENDULUM] * 5]
    assert heard[-1].last("done", "error")["state"] == "done"


def test_a_cancelled_run_stops(runner):
    heard = run(runner, ENDLESS)
    heard.last("running")
    runner.cancel()
    assert heard[-1] == {"event": "run", "run": heard[0]["run"], "state": "cancelled"}
    runner.cancel()
    assert [one["state"] for one in heard].count("cancelled") == 1
    assert finished(runner, FIVE_BAR)["state"] == "done"


def test_a_process_that_does_not_stop_is_replaced(runner):
    wait_until(lambda: runner._spare is not None and runner._spare.ready, what="the spare process")
    active = runner._active.process
    run(runner, ENDLESS).last("running")
    os.kill(active.pid, signal.SIGSTOP)
    assert finished(runner, FIVE_BAR)["state"] == "done"
    assert active.wait(WITHIN) == -signal.SIGKILL


def test_a_process_that_does_not_stop_is_replaced_without_a_spare_one(monkeypatch):
    monkeypatch.setattr("paraflex.workbench.runs._LONGEST", 0.8)
    with Runner(spare=False) as runner:
        assert finished(runner, FIVE_BAR)["state"] == "done"
        for text in (ENDLESS, FIVE_BAR):
            run(runner, text).last("running", "done")
            os.kill(runner._active.process.pid, signal.SIGSTOP)
            assert finished(runner, FIVE_BAR)["state"] == "done"


def test_a_killed_process_is_replaced_and_one_line_names_it(runner):
    heard = run(runner, ENDLESS)
    heard.last("running")
    os.kill(runner._active.process.pid, signal.SIGKILL)
    event = heard.last("done", "error")
    assert event["text"].startswith("the process of the run ended before it (signal 9")
    assert "\n" not in event["text"]
    assert finished(runner, FIVE_BAR)["state"] == "done"


def test_a_killed_idle_process_is_replaced_without_a_word(runner):
    assert finished(runner, FIVE_BAR)["state"] == "done"
    killed = runner._active
    killed.process.kill()
    wait_until(lambda: runner._active is not killed, what="the loss")
    assert finished(runner, FIVE_BAR)["state"] == "done"


def test_ctrl_c_in_the_terminal_of_a_notebook_ends_no_run(runner):
    heard = run(runner, pf.library.text("3rrr"))
    heard.last("running")
    os.kill(runner._active.process.pid, signal.SIGINT)
    assert heard.last("done", "error")["state"] == "done"


def test_an_event_that_is_not_taken_ends_nothing(runner, capsys):
    def fail(event):
        raise ZeroDivisionError

    runner.start({"text": PENDULUM}, fail)
    assert finished(runner, FIVE_BAR)["state"] == "done"
    runner.start({"text": "name ="}, fail)
    wait_until(lambda: "ZeroDivisionError" in capsys.readouterr().err, what="the traceback")
    assert finished(runner, FIVE_BAR)["state"] == "done"


@contextmanager
def owner(tmp_path):
    """A program that runs a model without end, once its run has begun."""
    script, model = tmp_path / "owner.py", tmp_path / "model.toml"
    script.write_text(OWNER, encoding="utf-8")
    model.write_text(ENDLESS, encoding="utf-8")
    with started(sys.executable, script, model) as child:
        child.until(lambda: "running" in child.out)
        yield child


@pytest.mark.parametrize(("number", "group"), [(signal.SIGKILL, False), (signal.SIGTERM, False), (signal.SIGINT, True)])
def test_no_process_survives_its_owner(tmp_path, number, group):
    with owner(tmp_path) as child:
        assert child.descendants()
        child.send(number, group=group)
        child.end()
        wait_until(lambda: not child.descendants(), within=30.0, what="the end of the processes")
        assert child.err.count("Traceback") == (number == signal.SIGINT)


def test_a_closed_runner_has_no_process_and_takes_no_run():
    runner = Runner(spare=False)
    process = psutil.Process(runner._active.process.pid)
    heard = run(runner, FIVE_BAR)
    runner.close()
    wait_until(lambda: not process.is_running() or process.status() == psutil.STATUS_ZOMBIE, what="its end")
    assert "done" not in [one["state"] for one in heard]
    with pytest.raises(InputError, match="runner: is closed"):
        run(runner, FIVE_BAR)


def test_a_wrong_model_is_one_line_of_info(runner):
    text = FIVE_BAR.replace('"bar"', '"rod"')
    event = finished(runner, text, source="five.toml")
    with pytest.raises(InputError) as error:
        model_of(text, source="five.toml")
    assert (event["state"], event["text"]) == ("error", str(error.value))
    assert (event["error"]["field"], event["error"]["remedy"]) == (error.value.field, error.value.remedy)
    with pytest.raises(InputError, match="request: has no text"):
        runner.start({}, print)


def test_an_unreachable_path_has_its_time(runner):
    event = finished(runner, FIVE_BAR.replace("0.370", "0.570"))
    assert event["state"] == "error"
    assert event["error"]["kind"] == "UnreachablePathError"
    assert 0.0 <= event["error"]["time"] < 0.6


def test_a_run_that_fails_keeps_what_it_computed(runner):
    event = finished(runner, PENDULUM.replace("210e9", "210e4"))
    assert (event["state"], event["numbers"][0]["status"]) == ("done", "failed")
    (error,) = event["errors"]
    assert (error["mode"], error["kind"]) == ("", "IntegrationError")
    assert "bends to a slope" in error["text"]
    assert 0.0 < error["time"] < 2.0
    assert len(event["page"]["film"]["time"]) == 181


def test_a_defect_is_one_line_and_the_process_lives(monkeypatch):
    events = []
    monkeypatch.setattr("paraflex.workbench.computing.computed", lambda *_, **__: 1 / 0)
    answer({"text": FIVE_BAR}, events.append, lambda: False)
    assert [one["state"] for one in events] == ["error"]
    assert events[0]["text"] == "the run failed unexpectedly: ZeroDivisionError: division by zero"


def test_a_stale_run_sends_no_results():
    events = []
    answer({"text": FIVE_BAR, "preview": False}, events.append, lambda: True)
    assert events == []


@pytest.mark.parametrize("name", [*pf.library.names(), "four_bars:3"])
def test_a_program_makes_an_equal_mechanism(name):
    made = {}
    exec(leaving.program(pf.library.text(name)), made)
    mechanism = pf.load(name).mechanism
    assert made["mechanism"] == mechanism
    assert made["mechanism"].description == mechanism.description


TABLES = """
[prescribed.turn]
joint = "pivot"
table = [[0.0, 0.0], [1.0, 0.4], [2.0, 0.0]]

[load.push]
type = "force"
point = "beam.tip"
force = ["-k * pivot.rate", 0.0]

[sensor.gauge]
type = "strain"
body = "beam"
at = 0.1

[parameters]
k = 0.2
"""


def test_a_program_has_profiles_laws_sensors_and_payload():
    text = PENDULUM.replace(
        "[study]", f'{TABLES}\n[end_effector]\npoint = "beam.tip"\n\n[payload]\nmass = 0.1\n\n[study]'
    )
    made = {}
    exec(leaving.program(text), made)
    mechanism = model_of(text).mechanism
    assert made["mechanism"] == mechanism
    assert made["mechanism"].payload == mechanism.payload is not None
    assert len(mechanism.sensors) == len(mechanism.loads) == len(mechanism.prescribed) == 1


def test_a_program_has_names_of_the_file_and_executes_no_text_of_it():
    text = FIVE_BAR.replace("[section.bar]", '[section."class"]').replace('section = "bar"', 'section = "class"')
    text = text.replace('name = "five-bar"', 'name = "five\\nimport nothing\\u0000\\u2028import nothing"')
    program = leaving.program(text)
    assert "_class = pf.Section.rectangle(" in program
    made = {}
    exec(program, made)
    assert made["mechanism"] == model_of(text).mechanism


@pytest.mark.parametrize("name", ["five_bar", "raparm_i", "pendulum"])
def test_a_link_opens_the_same_text(name):
    text = pf.library.text(name).replace("\n", "\r\n") + "# Ω\n"
    link = leaving.link(text)
    assert link.startswith("#model=")
    assert leaving.text_of_link(f"http://127.0.0.1:8000/page{link}") == text


def packed(data):
    return "#model=" + base64.urlsafe_b64encode(data).decode().rstrip("=")


@pytest.mark.parametrize(
    ("link", "problem"),
    [
        ("", "no link of a model"),
        ("#other=abc", "no link of a model"),
        ("#model=", "damaged"),
        ("#model=a", "damaged"),
        ("#model=%2e%2e/", "damaged"),
        ("#model=" + "A" * 40_000, "too long"),
        (packed(b"not compressed"), "damaged"),
        (leaving.link(FIVE_BAR)[:-40], "damaged"),
        (leaving.link(FIVE_BAR)[:200] + "AAAA" + leaving.link(FIVE_BAR)[204:], "damaged"),
        (packed(zlib.compress(b"\xff\xfe")), "damaged"),
        (packed(zlib.compress(b"name") + b"more"), "damaged"),
        (packed(zlib.compress(b"a" * (FILE_BYTES + 1), 9)), "too large a model"),
    ],
)
def test_hostile_links_are_refused_in_one_line(link, problem):
    with pytest.raises(InputError, match=problem) as error:
        leaving.text_of_link(link)
    assert "\n" not in str(error.value)
    assert len(str(error.value)) < 300


def test_a_text_too_large_for_a_link_is_refused():
    noise = np.random.default_rng(1).bytes(40_000).hex()
    with pytest.raises(InputError, match="too large for a link"):
        leaving.link(noise)
    with pytest.raises(InputError, match="letters that no file can hold"):
        leaving.link("\ud800")


def test_report_drawings_and_film_are_written(tmp_path):
    page = leaving.report(FIVE_BAR, None, tmp_path / "out", source="five_bar")
    assert page == tmp_path / "out" / "report.html"
    assert "five-bar" in page.read_text(encoding="utf-8")
    expected = computed(model_of(FIVE_BAR)).result.data["tracking_rms_motion"].item()
    assert pf.load_results(tmp_path / "out")["tracking_rms_motion"].item() == pytest.approx(expected, rel=1e-9)
    files = leaving.figures(FIVE_BAR, None, tmp_path / "five bar")
    assert [file.name for file in files] == ["five bar.svg", "five bar.pdf", "five bar.png"]
    assert all(file.stat().st_size > 1000 for file in files)
    film = leaving.film(PENDULUM, None, tmp_path / "film.svg", magnify=2.0)
    assert film.read_text(encoding="utf-8").startswith("<svg")
    with pytest.raises(InputError, match="unknown kind of drawing"):
        leaving.figures(FIVE_BAR, None, tmp_path / "drawing", kinds=["bmp"])
    with pytest.raises(InputError, match="unknown kind of film"):
        leaving.film(PENDULUM, None, tmp_path / "film.mov")
