"""Parameters and expressions in model files: arithmetic and nothing else."""

import dataclasses
import math

import pytest

from paraflex.errors import InputError
from paraflex.expressions.evaluate import ExpressionError, evaluate, evaluate_parameters
from paraflex.files import library_file, load
from paraflex.mechanism import raparm_i

VALUES = {"l1": 0.25, "la": 0.1, "n": 3.0}


@pytest.mark.parametrize(
    ("text", "value"),
    [
        ("l1", 0.25),
        ("l1 - la", 0.15),
        ("-la", -0.1),
        ("2 * (l1 + la) / n", 0.7 / 3),
        ("l1 ** 2", 0.0625),
        ("30 * pi / 180", math.pi / 6),
        (" 7.5e-3 ", 0.0075),
        ("+1", 1.0),
        ("la * cos(pi / 3)", 0.05),
        ("sqrt(l1 ** 2 - 0.15 ** 2)", 0.2),
    ],
)
def test_expressions_are_arithmetic(text, value):
    assert evaluate(text, VALUES) == pytest.approx(value, rel=1e-15)


@pytest.mark.parametrize(
    ("text", "says"),
    [
        ("l1 -", "neither a number nor an expression"),
        ("0.25 metres", "unknown unit"),
        ("", "neither a number nor an expression"),
        ("l1; la", "neither a number nor an expression"),
        ("((((", "neither a number nor an expression"),
        ("lb", 'unknown parameter "lb"'),
        ("__import__('os').system('true')", "only numbers, parameters"),
        ("l1.real", "only numbers, parameters"),
        ("abs(l1)", 'the function "abs" has no derivative everywhere'),
        ("open(1)", 'unknown function "open"'),
        ("__import__('os')", "only numbers, parameters"),
        ("sin", "sin is a function"),
        ("sin(1, 2)", "sin takes one argument, not 2"),
        ("sin(x=1)", "only numbers, parameters"),
        ("sin(*l1)", "only numbers, parameters"),
        ("log(-1)", "not a finite number"),
        ("t", 'unknown parameter "t"'),
        ("9" * 150 + "e300", "not a finite number"),
        ("[l1][0]", "only numbers, parameters"),
        ("l1 if la else n", "only numbers, parameters"),
        ("l1 < la", "only numbers, parameters"),
        ("'a' * 3", "only numbers, parameters"),
        ("True", "only numbers, parameters"),
        ("1j", "only numbers, parameters"),
        ("l1 // la", "only numbers, parameters"),
        ("(x := 3)", "only numbers, parameters"),
        ("lambda: 1", "only numbers, parameters"),
        ("1 / (l1 - l1)", "a division by zero"),
        ("9 ** 9 ** 9 ** 9", "too large a number"),
        ("(-1) ** 0.5", "not a finite number"),
        ("1e308 * 10", "not a finite number"),
        ("+" * 150 + "1" * 60, "too long"),
    ],
)
def test_nothing_else_is_an_expression(text, says):
    with pytest.raises(ExpressionError) as caught:
        evaluate(text, VALUES)
    assert says in caught.value.problem


def test_parameters_may_be_expressions_of_others_in_any_order():
    table = {"lb": "l1 - la", "l1": 0.25, "la": "2 * e", "e": 0.05}
    assert evaluate_parameters(table) == pytest.approx({"lb": 0.15, "l1": 0.25, "la": 0.1, "e": 0.05})


@pytest.mark.parametrize(
    ("table", "says"),
    [
        ({"a": "b", "b": "c + 1", "c": "a"}, "parameters.a: a cycle of parameters, a -> b -> c -> a"),
        ({"a": "a"}, "parameters.a: a cycle of parameters, a -> a"),
        ({"a": "leng", "length": 1.0}, 'unknown parameter "leng" (got \'leng\'); did you mean "length"?'),
        ({"a": True}, "parameters.a: neither a number nor an expression"),
        ({"a": [1.0]}, "parameters.a: neither a number nor an expression"),
        ({"a": "2 * b", "b": {"c": 1.0}}, "parameters.b: neither a number nor an expression"),
        ({"a": math.inf}, "parameters.a: not a finite number"),
        ({"a-b": 1.0}, "parameters.a-b: not usable as a name"),
        ({"pi": 3.0}, "parameters.pi: not usable as a name"),
        ({"a": "1 / 0"}, "parameters.a: a division by zero"),
    ],
)
def test_parameters_that_make_no_sense_are_named(table, says):
    with pytest.raises(InputError) as caught:
        evaluate_parameters(table)
    assert says in str(caught.value)


def in_file(tmp_path, *changes):
    head, rest = library_file("raparm_i").read_text(encoding="utf-8").split("\n[", 1)
    text = f'{head}\n[parameters]\nl1 = 0.250\nla = 0.100\nhalf = "l1 / 2"\n[{rest}'
    for old, new in changes:
        assert old in text
        text = text.replace(old, new)
    file = tmp_path / "scaled.toml"
    file.write_text(text, encoding="utf-8")
    return file


def test_any_number_of_a_file_may_be_an_expression(tmp_path):
    file = in_file(
        tmp_path,
        ("length = 0.250 # m", 'length = "l1" # m'),
        ("length = 0.100 # m", 'length = "la" # m'),
        ("B1 = 0.250 }", 'B1 = "2 * half" }'),
        ("youngs_modulus = 70e9", 'youngs_modulus = "7 * 10 ** 10"'),
        ("A1 = [-0.100, 0.0]", 'A1 = ["-la", 0.0]'),
    )
    found, expected = load(file).mechanism, raparm_i()
    assert found == dataclasses.replace(expected, name=found.name)
    # One number changed: three kinds of field follow.
    longer = in_file(
        tmp_path,
        ("l1 = 0.250", "l1 = 0.300"),
        ("length = 0.250 # m", 'length = "l1" # m'),
        ("B1 = 0.250 }", 'B1 = "2 * half" }'),
        ("F1 = 0.250 }", 'F1 = "l1" }'),
        ("C = 0.250 }", 'C = "l1" }'),
        ("B2 = 0.250 }", 'B2 = "l1" }'),
        ("F2 = 0.250 }", 'F2 = "l1" }'),
    )
    assert load(longer).mechanism.body("link1").points["B1"] == pytest.approx(0.3)


@pytest.mark.parametrize(
    ("new", "says"),
    [
        (
            'length = "l2" # m',
            "body.link1.length: unknown parameter \"l2\" (got 'l2'); give the length in m; choose from l1, la, half",
        ),
        (
            'length = "open(1)" # m',
            "body.link1.length: unknown function \"open\" (got 'open(1)'); give the length in m; choose from sin",
        ),
        ('length = "la - l1" # m', "body.link1.length: must be positive (got -0.15)"),
        ('length = "1 / 0" # m', "body.link1.length: a division by zero"),
    ],
)
def test_expressions_that_fail_name_file_field_and_remedy(tmp_path, new, says):
    with pytest.raises(InputError) as caught:
        load(in_file(tmp_path, ("length = 0.250 # m", new)))
    assert says in str(caught.value)
    assert str(caught.value).startswith(str(tmp_path / "scaled.toml"))


def test_parameters_are_a_table(tmp_path):
    file = tmp_path / "odd.toml"
    file.write_text('parameters = 3\nname = "odd"\n')
    with pytest.raises(InputError, match="parameters: should be a table"):
        load(file)
