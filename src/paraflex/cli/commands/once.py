"""Commands that accept each option once, unless its help calls it repeatable."""

import copy
from typing import Any

from typer.core import TyperCommand, TyperOption

from paraflex.errors import InputError


class Command(TyperCommand):
    """Command that refuses a second value of an option that takes one."""

    def parse_args(self, ctx: Any, args: list[str]) -> list[str]:
        """Parse arguments as every command does, after a check for options given twice."""
        if not ctx.resilient_parsing:  # set during completion, when the line is incomplete
            self._refuse_single_dashes(args)
            self._refuse_second_values(ctx, list(args))
        return super().parse_args(ctx, args)

    def _refuse_single_dashes(self, args: list[str]) -> None:
        known = {flag for option in self.params for flag in (*option.opts, *option.secondary_opts)}
        for word in args:
            flag = f"-{word.partition('=')[0]}"
            if flag in known and not word.startswith("--") and len(word) > 2:
                raise InputError("one dash", field=word, remedy=f"did you mean {flag}?")

    def _refuse_second_values(self, ctx: Any, args: list[str]) -> None:
        twin = copy.copy(self)
        twin.params = [_repeatable(param) for param in self.params]
        given, _, _ = twin.make_parser(ctx).parse_args(args=args)
        for option in self.params:
            if not isinstance(option, TyperOption) or option.multiple or not option.name:
                continue
            values = given.get(option.name) or []
            # A switch may be repeated with the same value.
            if len(set(values) if option.is_flag else values) > 1:
                raise _duplicate_option(option, values)


def _repeatable(param: Any) -> Any:
    if not isinstance(param, TyperOption) or param.multiple:
        return param
    twin = copy.copy(param)
    twin.multiple = True
    return twin


def _duplicate_option(option: TyperOption, values: list[Any]) -> InputError:
    longest = max(option.opts, key=len)
    if option.is_flag:
        names = [longest if value else option.secondary_opts[0] for value in values]
        return InputError("given on and off", field=longest, value=" ".join(names), remedy="leave one of them out")
    return InputError(
        f"given {len(values)} times", field=longest, value=", ".join(map(str, values)),
        remedy="it takes one value: leave the others out",
    )  # fmt: skip
