"""The command line: `grebe` and its commands, each loaded only when it is called."""

from __future__ import annotations

import importlib
import sys

import click

from grebe.cli import output
from grebe.cli.flags import sentence
from grebe.cli.interruption import INTERRUPTED, heed_signals
from grebe.core.errors import GrebeError, InputError
from grebe.workflow.collector import leave_all, uncollected

COMMANDS = {
    "app": "plan, watch, steer and read a survey in a browser",
    "demo": "region, plan, simulated mission, maps and report in under a minute",
    "plan": "mesh a region into target sets and put them in order",
    "export": "hand a plan to a ground station, a GPS receiver or a map",
    "run": "steer a boat through every target set of a survey",
    "identify": "know a boat from a drive: masses, drags, thrusters, with standard errors",
    "doctor": "check the computer, the survey and the boat before they go out",
    "instruments": "the sondes that can be read: list them, watch one, pretend to be one",
    "autopilot": "stand in for a boat's autopilot, to rehearse without a boat",
    "physics": "be the water and the hull under ArduPilot's real firmware",
    "check": "flag suspect and failed samples by QARTOD's tests",
    "lag": "estimate the sensors' lag where one line was run twice",
    "adapt": "let a survey that was sailed go on where it pays",
    "map": "draw the maps of what was measured",
    "diff": "map what changed between surveys of the same water, and its trend",
    "report": "write one self-contained HTML page about a survey",
    "campaign": "simulate very many missions, and say what may be claimed of the next",
    "import": "turn a hand-driven track into a survey file",
    "paper": "reproduce the paper's figures, beside the numbers they must show",
    "show": "say what a survey file holds",
}

WELCOME = """\
Grebe surveys a lake with an unmanned boat and comes back with maps of its water.
  grebe demo                          see all of it, in under a minute
  grebe plan LAKE.geojson -o S.gpkg   plan a survey of a region (or of a track's hull)
  grebe run S.gpkg                    steer the boat through every target set
  grebe map S.gpkg --out maps         draw the maps; grebe report S.gpkg writes a page
  grebe --help                        all commands and what they take"""


class LazyGroup(click.Group):
    """A group that imports a command's module only when that command is called."""

    def list_commands(self, ctx: click.Context) -> list[str]:
        """Return the commands in the order of the work."""
        return list(COMMANDS)

    def get_command(self, ctx: click.Context, cmd_name: str) -> click.Command | None:
        """Import and return a command."""
        if cmd_name not in COMMANDS:
            return None
        with uncollected():
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
    """Run the command line and leave with the design's exit codes."""
    output.make_streams_safe()
    heed_signals()
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
        # An interruption within compiled code comes wrapped in one.
        if not _is_interruption(error):
            raise
        output.fail(INTERRUPTED)
        sys.exit(130)
    except OSError as error:
        # What cannot open a file names it, and every writer of one does: what is left is stdout.
        what = error.filename or "standard output cannot be written"
        output.give_up_stdout()
        output.fail(f"{what}: {error.strerror or error}.")
        sys.exit(InputError.exit_code)
    finally:
        leave_all()
