"""The command line: arguments, exit codes, progress; nothing else."""

import os
import sys
from typing import NoReturn

import click

from dvca_sumo.bench.cases import CasesError
from dvca_sumo.cli.benching import bench
from dvca_sumo.cli.listing import faults
from dvca_sumo.cli.output import ExitCode, OutputError, tell
from dvca_sumo.cli.running import run
from dvca_sumo.cli.screening import screen
from dvca_sumo.engine.processes import stop_once
from dvca_sumo.engine.protocol import RunFailedError
from dvca_sumo.interventions import FaultError
from dvca_sumo.roadmap import RoadMapError
from dvca_sumo.scenario import ScenarioError
from dvca_sumo.stack.bugs import BugError
from dvca_sumo.stack.reference import StackError
from dvca_sumo.store import StoreError

__all__ = ["ExitCode", "main"]

# The user's to mend: what each of them says is enough.
_TOLD = (ScenarioError, FaultError, StackError, BugError, RoadMapError, CasesError, StoreError, OutputError)


@click.group()
@click.version_option(package_name="dvca-sumo")
def program() -> None:
    """Find which component of an automated driving system caused a violation, and which message to open first."""


for command in (run, screen, faults, bench):
    program.add_command(command)


def main() -> NoReturn:
    """The program: every error is one line and an exit code of the contract."""
    stop_once()
    try:
        program.main(prog_name="dvca-sumo", standalone_mode=False)
    except click.exceptions.NoArgsIsHelpError as error:
        error.show()
        _leave(ExitCode.USAGE)
    except click.ClickException as error:
        tell(f"error: {error.format_message()}")
        _leave(ExitCode.USAGE)
    except _TOLD as error:
        tell(f"error: {error}")
        _leave(ExitCode.BAD_INPUT)
    except RunFailedError as error:
        tell(f"error: {error}")
        _leave(ExitCode.INTERNAL)
    except (KeyboardInterrupt, click.Abort):
        _leave_interrupted()
    except Exception as error:
        if isinstance(error.__context__, KeyboardInterrupt):  # of which click could not tell anybody
            _leave_interrupted()
        tell(f"internal error: {type(error).__name__}: {error} (set DVCA_SUMO_TRACEBACK=1 to see where)")
        if os.environ.get("DVCA_SUMO_TRACEBACK"):
            raise
        _leave(ExitCode.INTERNAL)
    sys.exit(ExitCode.NO_VIOLATION)


def _leave_interrupted() -> NoReturn:
    tell("interrupted")
    _leave(ExitCode.INTERRUPTED)


def _leave(code: ExitCode) -> NoReturn:
    sys.exit(int(code))
