"""Wrong files by the hundred, in a minute: each ends in a result or in one line of ours."""

import random
import sys
import tomllib
import warnings
from pathlib import Path

import pytest

from paraflex.errors import InputError, NumericalError

sys.path.append(str(Path(__file__).parents[1] / "benchmarks"))

import fuzz_models
import mutations


@pytest.mark.parametrize(("through", "cases"), [("info", 100), ("run", 80), ("study", 100)])
def test_wrong_files_end_in_results_or_in_errors_of_ours(through, cases):
    found = fuzz_models.fuzz(range(cases), through)
    assert found.failures == {}
    assert sum(found.counts.values()) == cases
    # Most are refused; were all of them, nothing behind the reading would be tried.
    assert found.counts["fine"] > 0.04 * cases


@pytest.mark.parametrize("kind", [mutations.MODELS, mutations.STUDIES])
def test_data_are_written_as_toml_that_says_the_same(kind):
    for text in mutations.originals(kind).values():
        data = tomllib.loads(text)
        assert tomllib.loads(mutations.toml_text(data)) == data


def test_a_seed_gives_the_same_case_and_every_change_occurs():
    texts = mutations.originals(mutations.MODELS)
    cases = [mutations.mutated(seed, texts) for seed in range(400)]
    assert cases[:50] == [mutations.mutated(seed, texts) for seed in range(50)]
    assert len({case.content for case in cases}) > 380
    done = {change.partition("(")[0] for case in cases for change in case.changes}
    changes = (*mutations._DATA_CHANGES, *mutations._NUMBERS, *mutations._TEXT_CHANGES)
    assert done >= {change.__name__ for change in changes}
    assert {case.origin for case in cases} == set(texts)


def overflow(case, file):
    warnings.warn("overflow encountered", RuntimeWarning, stacklevel=1)
    return ""


def raising(error):
    def through(case, file):
        raise error

    return through


@pytest.mark.parametrize(
    ("through", "kind"),
    [
        (lambda case, file: "", "fine"),
        (raising(InputError("is wrong", field="name")), "refused"),
        (raising(NumericalError("cannot be")), "stopped"),
        (raising(KeyError("x")), "traceback"),
        (raising(SystemExit(1)), "traceback"),
        (raising(InputError("is " + "very " * 1000 + "wrong", field="name")), "traceback"),
        (overflow, "warning"),
        (lambda case, file: "a number is nan", "silent"),
    ],
)
def test_the_fuzzer_tells_failures_apart(monkeypatch, tmp_path, through, kind):
    monkeypatch.setitem(fuzz_models._THROUGH, "load", through)
    assert fuzz_models.tried(mutations.Case(0, "", (), b""), "load", tmp_path)[0] == kind


def test_a_case_that_hangs_is_ended_and_the_next_one_tried():
    worker = fuzz_models._Worker("load", limit=60.0)
    try:
        worker.limit = 0.0
        assert worker.answer(0) == ("hang", "beyond 0 s")
        worker.limit = 60.0
        assert worker.answer(random.Random(0).randrange(10))[0] in fuzz_models.GOOD
    finally:
        worker.close()
