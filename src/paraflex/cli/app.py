"""Entry point of the `paraflex` command."""

import atexit
import errno
import gc
import io
import os
import sys
from typing import Annotated, Any

import typer

from paraflex.errors import InputError, ParaflexError, listed
from paraflex.seals import unsealed
from . import BAD_INPUT, FAILURE
from .collected import collecting
from .commands.once import Command
from .commands.requests import flags_of, with_options
from .commands.shell import COMMANDS, GROUPS
from .signals import exit_code

# Errors of the command line, of Click or of Typer's copy of it.
_USAGE: type[Exception] = typer.BadParameter.__bases__[0]
# Options of other programs, and those of paraflex for the same.
_MEANT = {"--rpm": 'write --speed "60 rpm"', "--range": 'write --from "0 deg" --to "90 deg"',
          "--flywheel": "write --fluctuation 0.02"}  # fmt: skip

app: typer.Typer = typer.Typer(
    name="paraflex",
    help="Rigid-flexible dynamics of planar mechanisms with closed loops and several actuation modes.",
    no_args_is_help=True,
    pretty_exceptions_enable=False,
    rich_markup_mode=None,
)

_groups = {name: typer.Typer(help=about, no_args_is_help=True, rich_markup_mode=None) for name, about in GROUPS.items()}
for _one in COMMANDS:
    _group, _name = _one.name.rpartition(" ")[::2]
    _to = _groups[_group] if _group else app
    _to.command(_name, cls=Command, help=_one.help)(with_options(_one.request, _one.answer))
    if _one.name == "optimise":
        app.command("optimize", cls=Command, hidden=True, help=_one.help)(with_options(_one.request, _one.answer))

for _group, _commands in _groups.items():
    app.add_typer(_commands, name=_group)


def all_commands(group: Any) -> dict[str, Any]:
    """Return the Click commands by name, in the order of the help; a command in a group is named "group command"."""
    found = {}
    for name, command in group.commands.items():
        inner = all_commands(command) if hasattr(command, "commands") else None
        found |= {name: command} if inner is None else {f"{name} {one}": each for one, each in inner.items()}
    return found


def _show_version(requested: bool) -> None:
    if requested:
        from importlib.metadata import version

        typer.echo(f"paraflex {version('paraflex')}")
        raise typer.Exit


@app.callback()
def _options(
    context: typer.Context,
    version: Annotated[
        bool, typer.Option("--version", callback=_show_version, is_eager=True, help="Show the version and exit.")
    ] = False,
) -> None:
    context.with_resource(collecting())


def main() -> None:
    """Run the command line; errors of paraflex and interrupts are printed as one line and set the exit code."""
    _set_up()
    try:
        sys.exit(app(standalone_mode=False))
    except _USAGE as error:
        # A command without arguments answers with its help.
        without = type(error).__name__ == "NoArgsIsHelpError"
        typer.echo(str(error), err=True) if without else _print_error(_usage(error))
        sys.exit(BAD_INPUT)
    except typer.Abort:
        sys.exit(FAILURE)
    except InputError as error:
        _print_error(error)
        sys.exit(BAD_INPUT)
    except ParaflexError as error:
        _print_error(error)
        sys.exit(FAILURE)
    except OSError as error:
        # A file name that is too long raises this error wherever the file is first looked up.
        if error.errno != errno.ENAMETOOLONG:
            raise
        _print_error(
            InputError("the name is too long", field="file", value=error.filename, remedy="choose a shorter one")
        )
        sys.exit(BAD_INPUT)
    except Exception as error:
        # An unsealed file may hold anything and so lead to any error; otherwise the traceback is wanted.
        if not unsealed:
            raise
        why = f"holds something other than what paraflex writes ({type(error).__name__})"
        _print_error(InputError(why, field=str(unsealed[-1]), remedy="repeat the command that wrote it"))
        sys.exit(BAD_INPUT)
    except KeyboardInterrupt as interrupt:
        typer.echo(": ".join(["interrupted", *map(str, interrupt.args)]), err=True)
        sys.exit(exit_code())


def _usage(error: Any) -> InputError:
    """Return an error of the command line as one of this package: option, problem, value and remedy."""
    command = "" if error.ctx is None else error.ctx.command_path.rpartition("paraflex")[2].strip()
    text = error.format_message().removesuffix(".")
    if isinstance(error, typer.BadParameter) and error.param is not None:
        problem, _, remedy = error.message.partition("; ")
        return InputError(problem, field=max(error.param.opts, key=len), remedy=remedy)
    option, alike = getattr(error, "option_name", ""), getattr(error, "possibilities", ())
    if option and hasattr(error, "possibilities"):
        others = [one.name for one in COMMANDS if option in flags_of(one.request)]
        # "-d" has the letter of "--drive".
        params = [] if error.ctx is None else error.ctx.command.params
        alike = alike or [flag for one in params for flag in one.opts if flag.startswith(f"-{option}")]
        alike = [flag for flag in alike if flag != "--help"]
        remedy = f"did you mean {' or '.join(sorted(alike))}?" if alike else "--help lists all"
        remedy = f"it is one of paraflex {listed(others, 3)}" if others else remedy
        problem = f"no such option of paraflex {command}".strip()
        return InputError(problem, field=option, remedy=_MEANT.get(option, remedy))
    if option:
        return InputError("has no value", field=option, remedy="write one behind it; --help describes it")
    if "extra argument" in text:
        value, remedy = text.rpartition("(")[2].rstrip(")"), 'options begin with "--"; texts with blanks need quotes'
        return InputError("unexpected argument", field=command, value=value, remedy=remedy)
    problem, near = (part[:1].lower() + part[1:] for part in text.partition(". ")[::2])
    return InputError(problem, field=command or "paraflex", remedy=near or "see --help")


def _set_up() -> None:
    """Set process options that make commands start faster, before NumPy is imported, and those of the output."""
    # A character that the encoding of the terminal lacks must not end a command.
    for stream in (sys.stdout, sys.stderr):
        if isinstance(stream, io.TextIOWrapper):
            stream.reconfigure(errors="replace")
    # Imports create a hundred thousand persistent objects: collecting garbage among them takes a tenth of the time.
    gc.set_threshold(100_000, 20, 100)
    # So does collecting it as the process ends, where nothing is left to be done with it.
    atexit.register(gc.freeze)
    # Dense matrices are small here, and BLAS threads wait for one another if cores are busy.
    os.environ.setdefault("OPENBLAS_NUM_THREADS", "1")


def _print_error(error: Exception) -> None:
    typer.echo(f"error: {error}", err=True)
