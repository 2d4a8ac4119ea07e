"""Scripts over a document: the names they have, a prompt that runs them, and help while they are typed."""

from studio_core.scripting.completion import Completion, completions, hint
from studio_core.scripting.interpreter import Interpreter, Outcome, complete, indentation
from studio_core.scripting.names import Names
from studio_core.scripting.spelled import spelled

__all__ = [
    "Completion",
    "Interpreter",
    "Names",
    "Outcome",
    "complete",
    "completions",
    "hint",
    "indentation",
    "spelled",
]
