"""The exceptions that Grebe raises deliberately.

The tree, with the exit code of the command line for each branch::

    GrebeError
    |- UsageError         2   a command or a setting is invalid
    |- InputError         3   a file or a value from outside is not what it should be
    |  |- RegionError         an outline that cannot be surveyed
    |  |- TrackError          a track that cannot be read
    |  |- VesselError         an unknown or impossible vessel
    |  `- SurveyFileError     a survey file that is damaged, newer, or in the way
    |- PlanError          4   the input is sound, but no plan exists for it
    |- LinkError          5   the boat does not answer
    |- StoppedError       6   the operator stopped the mission
    `- IncompleteError    7   the mission ended with targets unreached

An expected failure inside the control loop, such as a step that does not converge, is not an
exception but a value, `grebe.control.solvers.base.Status`.
"""

from __future__ import annotations


class GrebeError(Exception):
    """Base of the tree. The message is one sentence: what was given, and what to do.

    `settings` names the settings that could be changed, as the library calls them (`cell_m`,
    `force`). A front end translates them into its flags or fields.
    """

    exit_code = 1

    def __init__(self, message: str, *, settings: tuple[str, ...] = ()) -> None:
        super().__init__(message)
        self.settings = settings


class UsageError(GrebeError):
    """A command or a setting is invalid."""

    exit_code = 2


class InputError(GrebeError):
    """A file or a value from outside is not what it should be."""

    exit_code = 3


class RegionError(InputError):
    """An outline that cannot be surveyed."""


class TrackError(InputError):
    """A track that cannot be read."""


class VesselError(InputError):
    """An unknown or impossible vessel."""


class SurveyFileError(InputError):
    """A survey file that is damaged, of a newer schema, or in the way."""


class PlanError(GrebeError):
    """The input is sound, but no plan exists for it."""

    exit_code = 4


class LinkError(GrebeError):
    """The boat does not answer."""

    exit_code = 5


class StoppedError(GrebeError):
    """The operator stopped the mission."""

    exit_code = 6


class IncompleteError(GrebeError):
    """The mission ended with targets unreached."""

    exit_code = 7
