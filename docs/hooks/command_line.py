"""The page of the command line, from the commands themselves."""

from __future__ import annotations

import re
from typing import Any

from mkdocs.structure.files import File, Files
from typer.main import get_command

from paraflex.cli.app import all_commands, app

PAGE = "reference/command-line.md"

HEAD = """# The command line

This page is made from the commands themselves; `paraflex COMMAND --help` says the same.

Exit codes: 0 done, 1 numerical trouble (what was computed is kept and marked), 2 bad input (one line says which file,
field and value, and what to do), 130 interrupted by Ctrl-C,
143 by SIGTERM, 129 by a terminal that closes (what was computed is kept and marked).

Commands of a model take its name or file as an argument or by `--mechanism`. An option takes one value; a second one
is an error, unless its text says *repeatable*.

A command that writes where results lie says what it replaces, before it computes; `--out` names another folder.

A mode that begins with a minus sign needs an equals sign: `--mode=-+-+`.

| Command | |
|---|---|
"""


def on_files(files: Files, config: Any) -> Files:
    """Add the page."""
    files.append(File.generated(config, PAGE, content=command_line_page()))
    return files


def command_line_page() -> str:
    """All commands that are not hidden, in the order of `paraflex --help`."""
    group: Any = get_command(app)
    commands = {name: command for name, command in all_commands(group).items() if not command.hidden}
    rows = "".join(
        f"| [`{name}`](#{name.replace(' ', '-')}) | {_first(command.help)} |\n" for name, command in commands.items()
    )
    general = _options("Of `paraflex` itself", [*group.params, *_completion()])
    return f"{HEAD}{rows}\n{general}\n" + "\n".join(_command(name, command) for name, command in commands.items())


def _command(name: str, command: Any) -> str:
    arguments = [parameter for parameter in command.params if _is_argument(parameter)]
    options = [parameter for parameter in command.params if not _is_argument(parameter)]
    usage = " ".join([f"paraflex {name}", *(_usage(argument) for argument in arguments), "[OPTIONS]"])
    parts = [f"## {name}", f"```text\n{usage}\n```", command.help, _options("Argument", arguments)]
    return "\n\n".join([*parts, _options("Option", options)]) + "\n"


def _options(heading: str, parameters: list[Any]) -> str:
    if not parameters:
        return ""
    rows = "".join(f"| {_name(parameter)} | {_meaning(parameter)} |\n" for parameter in parameters)
    return f"| {heading} | |\n|---|---|\n{rows}"


def _is_argument(parameter: Any) -> bool:
    return not parameter.opts[0].startswith("-")


def _usage(argument: Any) -> str:
    shown = argument.metavar or argument.name.upper()
    return shown if argument.required else f"[{shown}]"


def _name(parameter: Any) -> str:
    if _is_argument(parameter):
        return f"`{_usage(parameter)}`"
    names = ", ".join(f"`{name}`" for name in (*parameter.opts, *parameter.secondary_opts))
    shown = "" if parameter.is_flag else f" `{parameter.metavar or 'VALUE'}`"
    return _in_table(names + shown)


def _meaning(parameter: Any) -> str:
    text = re.sub(r"--[a-z-]+", lambda option: f"`{option[0]}`", parameter.help or "")
    default = parameter.default
    shown = "" if default in (None, False, "") or "Default" in text else f" Default: `{default}`."
    return _in_table(text + shown)


def _in_table(text: str) -> str:
    # Between backticks a bar divides no cells.
    whole = re.sub(r"(`[^`]*`)|\|", lambda found: found[1] or r"\|", text)
    return whole.replace("\n", " ").replace("<", "&lt;")


def _first(text: str) -> str:
    return _in_table(text.split("\n\n")[0])


def _completion() -> list[Any]:
    """The two options that Typer adds when the program runs under its own name."""
    return [
        _Plain(["--install-completion"], "Install completion for the shell in use."),
        _Plain(["--show-completion"], "Print the completion script, to copy it or to install it elsewhere."),
        _Plain(["--help"], "Show what there is and exit; also after every command."),
    ]


class _Plain:
    """An option as a row of the table."""

    secondary_opts = ()
    is_flag = True
    default = None

    def __init__(self, opts: list[str], text: str) -> None:
        self.opts, self.help = opts, text
