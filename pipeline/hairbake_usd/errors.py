"""Errors in an input file, as `hairbake` shows them to the user."""

from dataclasses import dataclass


@dataclass(frozen=True)
class InputError:
    """One error in a file."""

    key: str
    """Path of the prim or attribute, or name of the metadata; empty for the file itself."""
    message: str
    """What is wrong, with the value found."""
    allowed: str
    """Allowed values."""
    help: str
    """What to do."""
    file: str | None = None
    """The layer that holds it; None for the file that is read."""
    line: int | None = None
    """Line of its text, from 1; None for a binary file or the file as a whole."""
    column: int = 1
    """Column, from 1."""


class InputErrors(Exception):  # noqa: N818 It holds several errors.
    """All errors found in a file."""

    def __init__(self, *errors: InputError) -> None:
        """One or more errors."""
        super().__init__("; ".join(f"{error.key}: {error.message}" for error in errors))
        self.errors = list(errors)


def input_error(key: object, message: str, allowed: str, help: str) -> InputErrors:
    """A single error, to be raised; `key` is a path or a name."""
    return InputErrors(InputError(str(key), message, allowed, help))
