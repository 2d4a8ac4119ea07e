"""Errors that reach a person: each message is one sentence naming what went wrong and why."""


class LucarneError(Exception):
    """Base of every error the program raises on purpose; its text may be shown as it stands."""


class EditError(LucarneError):
    """An edit does not fit the scene it was applied to; the scene stays as it was."""


class ProjectError(LucarneError):
    """A project file is damaged, hostile, too new, or cannot be written."""


class InputError(LucarneError):
    """A mesh, picture or other input file cannot be used; names the file and the cause."""


class PluginError(LucarneError):
    """A plugin could not be loaded or misbehaved; names the plugin."""


class Cancelled(Exception):  # noqa: N818 - a signal, not an error
    """Raised by a job's checkpoint after the job was cancelled."""
