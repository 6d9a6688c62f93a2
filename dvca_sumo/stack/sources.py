"""Where a stack comes from: the words of the command line -> a factory."""

import contextlib
import importlib
import sys
import tomllib
from pathlib import Path

import msgspec

from dvca_sumo.stack.bugs import BugError, build_with
from dvca_sumo.stack.reference import Stack, StackConfig, StackContext, StackError, StackFactory, reference_stack


class StackSource(msgspec.Struct, frozen=True):
    """Which stack is to drive: words of the command line, as they are handed to other processes."""

    stack: str | None = None  # of `--stack`; None is the reference stack
    bug: str | None = None  # of `--bug`

    @property
    def is_reference(self) -> bool:
        """Whether it is the reference stack, with whatever parameters: a bug is a switch of these."""
        return self.stack is None or self.stack.endswith(".toml")


def stack_factory(source: StackSource) -> StackFactory:
    """The stack that is asked for: the reference one, parameters of it (FILE.toml), or MODULE:FACTORY.

    A factory is called as `factory(context)` with a `StackContext` and returns a `Stack`.

    Raises:
        StackError: The file or factory cannot be read or imported, or holds something else.
        BugError: No bug has that name, or the stack is not the reference one.
    """
    stack, bug = source.stack, source.bug
    if source.is_reference:
        config = StackConfig() if stack is None else _config(Path(stack))
        build = config if bug is None else build_with(bug, config)

        def factory(context: StackContext) -> Stack:
            return reference_stack(context, build)

        return factory if stack is None else built_checked(stack, factory, "stack file")
    assert stack is not None  # or it would be the reference stack
    if bug is not None:
        raise BugError(f"bug {bug!r} is a switch of the reference stack; {stack!r} has none")
    module_name, separator, name = stack.partition(":")
    if not separator:
        raise StackError(f"no stack {stack!r} (allowed: MODULE:FACTORY or FILE.toml)")
    if "" not in sys.path:
        sys.path.insert(0, "")  # a user's module lies where the command is typed
    try:
        with contextlib.redirect_stdout(sys.stderr):  # standard output is the result's alone
            factory = getattr(importlib.import_module(module_name), name)
    except (Exception, SystemExit) as error:  # noqa: BLE001 - a user's module may raise anything while it is imported
        raise StackError(f"stack factory {stack!r} cannot be imported: {_said(error)}") from None
    if not callable(factory):
        raise StackError(f"stack factory {stack!r} is not callable: {factory!r}")
    return built_checked(stack, factory)


def files_of(source: StackSource) -> dict[str, Path]:
    """By name, what the stack is made of beside this package, its factory being imported already.

    That is a file of parameters; or the factory's module, and the Python files imported so far that lie where it or its
    package does. What else a user's stack reads is not known.
    """
    if source.stack is None:
        return {}
    if source.is_reference:
        return {"parameters": Path(source.stack)}
    name = source.stack.partition(":")[0]
    place = getattr(sys.modules[name], "__file__", None)  # none of what is built into Python
    if place is None:
        return {}
    root = Path(place).resolve().parents[name.count(".") + (Path(place).stem == "__init__")]
    paths = [Path(file).resolve() for module in [*sys.modules.values()] if (file := getattr(module, "__file__", None))]
    beside = [path for path in paths if path.is_relative_to(root) and path.is_file()]  # of an archive, none is
    return {path.relative_to(root).as_posix(): path for path in beside}


def built_checked(source: str, factory: StackFactory, kind: str = "stack factory") -> StackFactory:
    """`factory`, whose failures and wrong results are named as those of `source`, a `kind`."""

    def build(context: StackContext) -> Stack:
        try:
            stack = factory(context)
        except (Exception, SystemExit) as error:
            raise StackError(f"{kind} {source!r} raised {_said(error)}") from error
        if not isinstance(stack, Stack):
            raise StackError(f"{kind} {source!r} returned {type(stack).__name__}, not a Stack")
        return stack

    return build


def _config(path: Path) -> StackConfig:
    try:
        return msgspec.toml.decode(path.read_bytes(), type=StackConfig)
    except OSError as error:
        raise StackError(f"stack file {path} cannot be read: {error.strerror}") from None
    except (msgspec.ValidationError, msgspec.DecodeError, tomllib.TOMLDecodeError) as error:
        raise StackError(f"stack file {path}: {error}") from None


def _said(error: BaseException) -> str:
    return f"{type(error).__name__}: {error}"
