"""Fields that take one of a few words, in every kind of file: missing or misspelt, the error says what they may be.

They are collected from the schemas, so that a field added later is covered.
"""

import copy
import tomllib

import pytest

from paraflex.designs.schema import SweepTable
from paraflex.errors import InputError
from paraflex.files import library_text
from paraflex.files.read import validate
from paraflex.files.schema import ModelTable, PathFile
from paraflex.studies.optimisation.schema import StudyTable

FILES = {
    "model": (ModelTable, tomllib.loads(library_text("five_bar"))),
    "path": (PathFile, {}),
    "sweep": (SweepTable, {"mechanism": "five_bar"}),
    "search": (StudyTable, {"mechanism": "five_bar"}),
}
# What stands for a name that the user chooses.
NAME = "some"
# What stands beside tables within tables of paths.
BESIDE = {"shaper": {"type": "line", "start": [0.0, 0.3], "end": [0.1, 0.3], "max_acceleration": 1.0}}


def choices(schema, field, place=(), beside=None):
    """Of every field that takes one of a few words: place, words, whether it is needed, what must stand beside it."""
    field = resolved(schema, field)
    if "enum" in field:
        yield place, field["enum"], False, beside or {}
    mapping = field.get("discriminator", {}).get("mapping", {})
    if mapping:
        yield (*place, field["discriminator"]["propertyName"]), list(mapping), True, {}
    for variant in [*field.get("anyOf", []), *field.get("oneOf", [])]:
        yield from choices(schema, variant, place, beside)
    properties, required = field.get("properties", {}), field.get("required", [])
    needs = {name: example(schema, properties[name]) for name in required}
    for name, inner in properties.items():
        for at, words, needed, others in choices(schema, inner, (*place, name), needs):
            yield at, words, needed or (at == (*place, name) and name in required), others
    if isinstance(field.get("additionalProperties"), dict):
        yield from choices(schema, field["additionalProperties"], (*place, NAME))


def resolved(schema, field):
    return schema["$defs"][field["$ref"].rsplit("/", 1)[-1]] if "$ref" in field else field


def example(schema, field):
    """Something of the type of a field."""
    field = resolved(schema, (field.get("anyOf") or field.get("oneOf") or [field])[0])
    if "const" in field or "enum" in field:
        return field.get("const") or field["enum"][0]
    if field["type"] == "array":
        return [example(schema, field["items"])] * field.get("minItems", 0)
    return {"string": "text", "number": 1.0, "integer": 1, "object": {}}[field["type"]]


def collected():
    for kind, (table, _) in FILES.items():
        schema = table.model_json_schema()
        found = {place: rest for place, *rest in choices(schema, schema)}
        for place, (words, needed, beside) in found.items():
            yield pytest.param(kind, place, words, needed, beside, id=f"{kind} {'.'.join(place)}")


CASES = [*collected()]
TAGS = [case for case in CASES if case.values[3]]
EACH = ("kind", "place", "words", "needed", "beside")


def problem(kind, place, content):
    """The error of a file with one table more."""
    table, base = FILES[kind]
    data = copy.deepcopy(base)
    inner = data
    for part in place[:-1]:
        inner.update(BESIDE.get(part, {}) if place[0] != "study" else {})
        inner = inner.setdefault(part, {})
    for name, value in content.items():
        inner[name] = value
    with pytest.raises(InputError) as error:
        validate(table, data, "file.toml")
    return str(error.value)


def test_all_tagged_tables_are_found():
    places = {".".join(case.values[1]) for case in TAGS}
    members = {f"{table}.some.type" for table in ("body", "controller", "joint", "load", "path", "sensor")}
    shapers = {f"{place}.shaper.type" for place in ("path", "path.some", "study")}
    assert places == members | shapers | {"path.type", "sensor.some.axis"}
    others = {".".join(case.values[1]) for case in CASES if not case.values[3]}
    assert {"sampling.kind", "search.method", "objective.over", "study.after", "vary.some.scale"} < others


@pytest.mark.parametrize(EACH, CASES)
def test_a_misspelt_word_is_answered_by_the_nearest(kind, place, words, needed, beside):
    for word in words:
        wrong = word[:-1] + "x" + word[-1]
        says = problem(kind, place, beside | {place[-1]: wrong})
        assert says.startswith(f"file.toml: {'.'.join(place)}: ")
        assert f"(got {wrong!r})" in says
        assert f'did you mean "{word}"?' in says


@pytest.mark.parametrize(EACH, CASES)
def test_a_word_far_from_all_is_answered_by_all(kind, place, words, needed, beside):
    says = problem(kind, place, beside | {place[-1]: "qqqq"})
    assert all(f'"{word}"' in says or f"'{word}'" in says for word in words)
    assert "did you mean" not in says


@pytest.mark.parametrize(EACH, TAGS)
def test_a_missing_tag_is_said_to_be_missing_with_what_it_may_be(kind, place, words, needed, beside):
    says = problem(kind, place, {name: value for name, value in beside.items() if name != place[-1]})
    assert says.startswith(f"file.toml: {'.'.join(place)}: is missing; ")
    assert all(f'"{word}"' in says for word in words)


@pytest.mark.parametrize(EACH, TAGS)
def test_a_tag_under_another_name_is_found(kind, place, words, needed, beside):
    says = problem(kind, place, {"typ": words[0]})
    assert says == f"file.toml: {'.'.join(place[:-1])}.typ: unknown field (got '{words[0]}'); did you mean \"type\"?"
