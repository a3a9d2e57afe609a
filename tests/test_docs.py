"""Pages for newcomers are run block by block; pages made from the code say what the code says."""

import os
import re
import subprocess
import sys
from pathlib import Path

import pytest
import yaml

from pages import blocks_of, check_output, run_page, with_numbers_of

ROOT = Path(__file__).parents[1]
DOCS = ROOT / "docs"
MAKEFILE, MKDOCS = ((ROOT / name).read_text(encoding="utf-8") for name in ("Makefile", "mkdocs.yml"))
sys.path.append(str(ROOT / "benchmarks"))

import documented  # noqa: E402


@pytest.mark.parametrize(
    ("page", "least"),
    [
        ("tutorial.md", 8),
        ("first-mechanism.md", 7),
        ("modes.md", 3),
        ("index.md", 2),
        ("interface.md", 3),
        ("validity.md", 1),
        ("findings.md", 2),
        ("python-mechanisms.md", 6),
        ("stresses.md", 2),
        ("quick-return.md", 4),
        ("kinematics.md", 4),
        ("linear-models.md", 3),
        ("shaping.md", 3),
        ("reduction.md", 5),
        ("reduced-runs.md", 1),
        ("regulators.md", 2),
        ("learning.md", 4),
        ("statics.md", 3),
        ("flexures.md", 6),
        ("control.md", 4),
        ("closed-loop.md", 9),
    ],
)
def test_blocks_of_a_page_run_and_print_what_it_shows(page, least, tmp_path, monkeypatch):
    assert run_page(DOCS / page, tmp_path, monkeypatch) >= least


def test_numbers_of_pages_are_those_that_were_measured():
    """`python benchmarks/documented.py write` would change nothing."""
    marks = 0
    for page in documented.pages():
        text = page.read_text(encoding="utf-8")
        marks += len(documented.MARK.findall(text))
        # Markdown takes a line that begins so for a block of HTML, and ends the paragraph.
        assert not re.search("^<!--=", text, re.MULTILINE), f"{page.name}: a mark at the beginning of a line"
        assert documented.filled(text) == text, f"{page.name}: run python benchmarks/documented.py write"
    assert marks > 60


def test_a_number_that_was_not_measured_is_noticed(tmp_path, monkeypatch):
    monkeypatch.setattr(documented, "MEASURED", tmp_path)
    mark = "<!--=x.some.0 1e3 .2f-->{}<!--/-->"
    assert documented.filled(mark.format("6.19")) == mark.format(documented.NOT_MEASURED)
    (tmp_path / "x.json").write_text('{"some": [0.00735]}')
    assert documented.filled(mark.format("6.19")) == mark.format("7.35")
    of_run = "<!--=run .1f 2.0 * error-->1.0<!--/-->"
    assert documented.filled(of_run) == of_run
    assert documented.filled(of_run, {"error": 0.7}) == of_run.replace("1.0", "1.4")


def test_shown_lines_take_the_numbers_that_were_printed():
    shown, printed = "...\n error 0.63 mm\n ++   1.5e-04\n...\n", "loaded\n error 0.70 mm\n ++   2.5e-03\nend\n"
    assert with_numbers_of(shown, printed) == "...\n error 0.70 mm\n ++   2.5e-03\n...\n"
    with pytest.raises(AssertionError, match="printed"):
        with_numbers_of("errors 0.63 mm", printed)


def test_example_of_the_readme_runs(tmp_path, monkeypatch, capsys):
    block, *others = [block for block in blocks_of(ROOT / "README.md") if block.language == "python"]
    assert not others
    monkeypatch.chdir(tmp_path)
    exec(compile(block.text, "README.md", "exec"), {})
    assert (tmp_path / "path.png").stat().st_size > 10_000
    # The block prints the tracking error in ++++; converged 6.554e-4 m, the default tolerance gives it to 1 %.
    assert float(capsys.readouterr().out) == pytest.approx(6.554e-4, rel=0.01)


@pytest.mark.parametrize(
    ("shown", "printed", "same"),
    [
        ("error 0.630 mm", "error 0.634 mm", True),
        ("error 0.630 mm", "error 0.640 mm", False),
        ("error 0.630 mm", "errors 0.630 mm", False),
        ("a 1\n...\nb 2", "a 1\nc\nd\nb 2", True),
        ("a 1\n...\nb 2", "a 1\nc\nd\nb 3", False),
        ("a 1", "a 1\nb 2", False),
        ("peak 5 at 12", "peak 5", False),
        ("", "said something", False),
    ],
)
def test_output_is_compared(shown, printed, same):
    if same:
        check_output(shown, printed)
    else:
        with pytest.raises(AssertionError):
            check_output(shown, printed)


def test_links_between_pages_and_images_exist():
    """MkDocs checks links of pages; those of files outside it are checked here."""
    for page in (ROOT / "README.md", ROOT / "CONTRIBUTING.md"):
        for target in re.findall(r"\]\((?!https?:)([^)#]+)", page.read_text(encoding="utf-8")):
            assert (ROOT / target).exists(), f"{page.name}: {target}"


BUILD = [sys.executable, "-m", *re.search(r"\$\(BIN\)/(mkdocs build .*) --site-dir", MAKEFILE)[1].split()]


def built(folder, text):
    """MkDocs on one page, by the command of `make docs` and with the project's settings of what is checked."""
    checked = yaml.safe_load(re.search(r"^validation:\n(?: .*\n)+", MKDOCS, re.MULTILINE)[0])
    (folder / "docs").mkdir(exist_ok=True)
    (folder / "docs" / "index.md").write_text(text, encoding="utf-8")
    settings = {"site_name": "a", "nav": [{"Home": "index.md"}], "plugins": [], **checked}
    (folder / "mkdocs.yml").write_text(yaml.safe_dump(settings), encoding="utf-8")
    return subprocess.run(
        BUILD, cwd=folder, capture_output=True, text=True, check=False, env=os.environ | {"NO_MKDOCS_2_WARNING": "1"}
    )


@pytest.mark.parametrize(
    ("text", "extra"),
    [
        ("[there](nowhere.md)", ""),
        ("[there](#nowhere)", ""),
        ("[there](/index.md)", ""),
        ("![there](nowhere.png)", ""),
        ("a page that is not in the navigation", "other.md"),
    ],
    ids=["page", "anchor", "absolute", "image", "navigation"],
)
def test_the_build_of_the_documentation_fails_on_a_warning(text, extra, tmp_path):
    done = built(tmp_path, "# Home\n\n[here](#home)\n")
    assert done.returncode == 0, done.stderr
    if extra:
        (tmp_path / "docs" / extra).write_text("# Other\n", encoding="utf-8")
    done = built(tmp_path, f"# Home\n\n{text}\n")
    assert done.returncode == 1
    assert "WARNING" in done.stderr


def test_the_gallery_shows_every_figure_of_the_catalogue(monkeypatch):
    monkeypatch.syspath_prepend(str(DOCS))
    import make_gallery

    assert (DOCS / "gallery.md").read_text(encoding="utf-8") == make_gallery.gallery_page()
    assert set(make_gallery.COMMANDS) == set(make_gallery.CATALOGUE)
    for kind in make_gallery.COMMANDS:
        for figure in make_gallery.shown(kind):
            assert (make_gallery.IMAGES / f"{figure.name}.png").is_file(), figure.name


@pytest.fixture
def hooks(monkeypatch):
    monkeypatch.syspath_prepend(str(DOCS / "hooks"))


@pytest.mark.usefixtures("hooks")
def test_every_command_and_option_stands_on_the_page():
    from typer.main import get_command

    from command_line import command_line_page
    from paraflex.cli.app import all_commands, app

    page = command_line_page()
    for name, command in all_commands(get_command(app)).items():
        assert (f"\n## {name}\n" in page) == (not command.hidden), name
        for parameter in command.params:
            assert all(f"`{option}`" in page for option in parameter.opts if option.startswith("-"))


@pytest.mark.usefixtures("hooks")
def test_every_field_of_a_model_file_stands_on_the_page():
    from file_format import file_format_page
    from paraflex.files import model_schema

    page, schema = file_format_page(), model_schema()
    tables = {"": schema, **schema["$defs"]}
    for name, table in tables.items():
        for field, content in table.get("properties", {}).items():
            if "const" not in content and (name or "$ref" not in str(content)):
                assert f"| `{field}` |" in page, (name, field)
                assert "description" in content or "$ref" in str(content), (name, field)


@pytest.mark.usefixtures("hooks")
def test_every_table_of_a_model_file_has_a_section_with_an_example():
    from file_format import file_format_page
    from paraflex.files import model_schema

    text = (DOCS / "model-file-tables.md").read_text(encoding="utf-8")
    sections = dict(re.findall(r"^## `\[([^]]+)\]`\n(.*?)(?=^## |\Z)", text, re.MULTILINE | re.DOTALL))
    top_level = {"name", "description", "geometry", "reference", "curvature", "gravity"}
    assert {name.removesuffix(".NAME") for name in sections} == set(model_schema()["properties"]) - top_level
    assert all("```toml\n" in section for section in sections.values())
    asked = set(re.findall(r"\(\.\./model-file-tables\.md#([\w-]+)\)", file_format_page()))
    assert asked <= {"top-level"} | {re.sub(r"[^\w-]", "", name.lower()) for name in sections}
    assert len(asked) > 15


def test_the_guide_to_the_model_file_shows_the_file_of_the_library():
    from paraflex.files import library_text

    blocks = [block for block in blocks_of(DOCS / "model-file.md") if block.language == "toml"]
    assert len(blocks) >= 10
    assert all(block.text in library_text("five_bar") for block in blocks)


def test_examples_of_tables_fit_the_schema():
    """Each block of whole tables, added to a file with the parameters that it names; others are parts of tables."""
    import tomllib

    from paraflex.files import load_data
    from paraflex.files.read import validate
    from paraflex.files.schema import ModelTable

    base, checked = load_data("3prr")[0], 0
    base["parameters"] |= {"a": 1.0, "w": 20.0}
    for block in blocks_of(DOCS / "model-file-tables.md"):
        if block.language == "toml" and "\n[" in f"\n{block.text}":
            data = tomllib.loads(block.text)
            for path in data.get("path", {}).values():
                # The rows of a file stand in place of its name when a file is read.
                path.update({"table": [[0.0, 0.0]] * 4} if "table" in path else {})
            parameters = base["parameters"] | data.get("parameters", {})
            validate(ModelTable, base | data | {"parameters": parameters}, "model-file-tables.md")
            checked += 1
    assert checked >= 30


@pytest.mark.usefixtures("hooks")
def test_every_public_name_stands_on_one_page():
    import paraflex
    from api import PACKAGES, _origin, on_files, public_names

    files = on_files([], _Config())
    pages = {file.src_uri: file.content_string for file in files}
    told = re.findall(r"^::: (\S+)$", "\n".join(pages.values()), flags=re.MULTILINE)
    origins = [_origin(*name.removeprefix("paraflex.").rsplit(".", 1)) for name in told]
    assert len(origins) == len(set(origins))
    for package in PACKAGES:
        for name in public_names(package):
            assert _origin(package, name) in origins, (package, name)
    index = pages["reference/api/index.md"]
    described = dict(re.findall(r"^\| \[`pf\.(\w+)`\]\S+ \| (.+) \|$", index, flags=re.MULTILINE))
    assert set(described) == set(paraflex.__all__)
    assert described["plan"].startswith("Plan a run of the end-effector along a path")


def test_the_page_of_the_interface_has_the_public_names_in_their_groups_and_no_others():
    import paraflex

    stub = (ROOT / "src" / "paraflex" / "__init__.pyi").read_text(encoding="utf-8")
    page = (DOCS / "interface.md").read_text(encoding="utf-8")
    listed, shown = {}, {}
    for group, text in re.findall(r"^# (.*)\n((?:(?!# ).*\n)+)", stub, re.MULTILINE):
        listed[group.split(":")[0]] = sorted(re.findall(r"(\w+) as \1", text))
    for title, text in re.findall(r"^##? (.*)\n((?:(?!##? ).*\n)+)", page, re.MULTILINE):
        for rows in re.findall(r"^\| Name \| \|\n.*\n((?:\|.*\n)+)", text, re.MULTILINE):
            shown[title] = sorted(re.findall(r"`(\w+)`", " ".join(row.split("|")[1] for row in rows.splitlines())))
    assert list(shown.values()) == list(listed.values())
    assert list(shown)[1:] == list(listed)[1:]
    assert sorted(name for names in shown.values() for name in names) == sorted(paraflex.__all__)
    assert set(re.findall(r"\bpf\.(\w+)", page)) <= set(paraflex.__all__)


class _Config:
    """As much of MkDocs' configuration as a generated file asks for."""

    site_dir = "site"
    use_directory_urls = True
    plugins = type("Plugins", (), {"_current_plugin": "api"})()


@pytest.mark.usefixtures("hooks")
def test_formulas_are_understood_or_refused():
    from mkdocs.exceptions import PluginError

    from mathematics import mathml

    made = mathml(
        r"\begin{aligned} a &amp;= \tfrac12 b \\ c &amp;= \Phi_q^{\mathsf T} \lambda \end{aligned}", "block", "page.md"
    )
    assert made.count("<mtr>") == 2
    assert "\N{GREEK SMALL LETTER LAMDA}" in made or "&#x003BB;" in made
    with pytest.raises(PluginError, match=r"page\.md"):
        mathml(r"\nosuchcommand{x}", "inline", "page.md")


@pytest.mark.usefixtures("hooks")
def test_benchmark_tables_come_from_what_was_measured():
    import json

    from mkdocs.exceptions import PluginError

    from benchmarks import MEASURED, on_page_markdown

    page = type("Page", (), {"file": type("File", (), {"src_uri": "benchmarks.md"})})
    table = on_page_markdown("<!-- measured: peers -->", page)
    results = json.loads((MEASURED / "peers.json").read_text(encoding="utf-8"))["results"]
    like = [result for result in results if ", linear" not in result["name"]]
    assert len(like) < len(results)
    # Like with like, its fastest first; linear beams in a table after it.
    first = next(line for line in table.splitlines() if line.startswith("| paraflex"))
    assert f"{min(result['seconds'] for result in like):.3f}" in first
    assert all(result["name"] in table for result in results)
    assert max(table.index(result["name"]) for result in like) < table.index(", linear")
    with pytest.raises(PluginError, match="no table 'pears'"):
        on_page_markdown("<!-- measured: pears -->", page)


@pytest.mark.usefixtures("hooks")
def test_every_table_of_measurements_that_pages_ask_for_can_be_made():
    import re

    from benchmarks import TABLES, on_page_markdown

    asked = {
        name
        for page in DOCS.glob("*.md")
        for name in re.findall(r"<!-- measured: (?!begin|end)(\w+) -->", page.read_text(encoding="utf-8"))
    }
    assert asked == set(TABLES)
    page = type("Page", (), {"file": type("File", (), {"src_uri": "trust.md"})})
    for name in sorted(asked):
        lines = on_page_markdown(f"<!-- measured: {name} -->", page).splitlines()
        rows = [line for line in lines if line.startswith("|")]
        assert len(rows) > 4
        assert not any("nan" in row for row in rows)


def test_tests_that_pages_name_exist():
    import re

    tests = "\n".join(path.read_text(encoding="utf-8") for path in (ROOT / "tests").glob("*.py"))
    for page in (ROOT / "README.md", *DOCS.glob("*.md")):
        for name in re.findall(r"`(?:tests/)?(test_\w+)(\.py)?`", page.read_text(encoding="utf-8")):
            found = (ROOT / "tests" / f"{name[0]}.py").exists() if name[1] else f"def {name[0]}(" in tests
            assert found, f"{page.name}: {name[0]}"
