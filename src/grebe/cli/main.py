"""The `grebe` command group. Each command's module is imported only when the command is called."""

from __future__ import annotations

import importlib
import sys

import click

from grebe.cli import output
from grebe.cli.flags import sentence
from grebe.cli.interruption import INTERRUPTED, handle_signals
from grebe.core.errors import GrebeError, InputError
from grebe.workflow.garbage_collection import leave_all, without_collection

COMMANDS = {
    "app": "plan, watch, steer and read surveys in a browser",
    "demo": "plan, simulate, map and report a small survey in under a minute",
    "plan": "mesh a region into target sets and put them in order",
    "export": "write a plan, or samples, for other programs",
    "run": "steer a boat through every target set of a survey",
    "identify": "fit a boat's model to a recorded drive, with standard errors",
    "doctor": "check the computer, the survey and the boat before departure",
    "instruments": "list the sondes that Grebe can read, watch one, or simulate one",
    "autopilot": "stand in for a boat's autopilot, to rehearse without a boat",
    "physics": "simulate the hull and the water for ArduPilot's real firmware",
    "check": "flag suspect and failed samples by QARTOD's tests",
    "lag": "estimate sensor lags from two runs along the same line",
    "adapt": "extend a finished survey where more readings improve its map most",
    "map": "draw maps of the measurements",
    "diff": "map changes and trends between surveys of the same water",
    "report": "write one self-contained HTML page about a survey",
    "campaign": "simulate thousands of missions and certify how often they succeed",
    "import": "turn a hand-driven track into a survey file",
    "paper": "reproduce the paper's figures and check their numbers",
    "show": "summarise a survey file",
}

WELCOME = """\
Grebe surveys a lake with an unmanned boat and comes back with maps of its water.
  grebe demo                          try everything in simulation, in under a minute
  grebe plan LAKE.geojson -o S.gpkg   plan a survey of a region (or of a track's hull)
  grebe run S.gpkg                    steer the boat through every target set
  grebe map S.gpkg --out maps         draw the maps; grebe report S.gpkg writes a page
  grebe --help                        list all commands"""


class LazyGroup(click.Group):
    """A group that imports a command's module only when that command is called."""

    def list_commands(self, ctx: click.Context) -> list[str]:
        """Return the commands in the order in which a survey uses them."""
        return list(COMMANDS)

    def get_command(self, ctx: click.Context, cmd_name: str) -> click.Command | None:
        """Import and return a command."""
        if cmd_name not in COMMANDS:
            return None
        with without_collection():
            module = importlib.import_module(f"grebe.cli.{cmd_name}_command")
        command: click.Command = module.command
        return command

    def format_commands(self, ctx: click.Context, formatter: click.HelpFormatter) -> None:
        """List the commands without importing them."""
        with formatter.section("Commands"):
            formatter.write_dl(list(COMMANDS.items()))


@click.group(cls=LazyGroup, invoke_without_command=True)
@click.version_option(package_name="grebe")
@click.pass_context
def grebe(ctx: click.Context) -> None:
    """Survey a lake with an unmanned boat and map its water."""
    if ctx.invoked_subcommand is None:
        click.echo(WELCOME)


def _is_interruption(error: BaseException | None) -> bool:
    while error is not None:
        if isinstance(error, KeyboardInterrupt):
            return True
        error = error.__cause__ or error.__context__
    return False


def main() -> None:
    """Run the command line and exit with the error's own exit code."""
    output.make_streams_safe()
    handle_signals()
    try:
        grebe.main(standalone_mode=False)
    except GrebeError as error:
        output.fail(sentence(error))
        sys.exit(error.exit_code)
    except click.ClickException as error:
        error.show()
        sys.exit(2)
    except (KeyboardInterrupt, click.Abort):
        output.fail(INTERRUPTED)
        sys.exit(130)
    except SystemError as error:
        # Compiled code wraps an interruption in a SystemError.
        if not _is_interruption(error):
            raise
        output.fail(INTERRUPTED)
        sys.exit(130)
    except OSError as error:
        # Errors of files carry the file's name. One without a name comes from stdout.
        what = error.filename or "standard output cannot be written"
        output.give_up_stdout()
        output.fail(f"{what}: {error.strerror or error}.")
        sys.exit(InputError.exit_code)
    finally:
        leave_all()
