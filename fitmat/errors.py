"""What fitmat raises when its input is wrong: one sentence that says what, where, got, expected, what to do.

A computation that failed is not raised: it is an outcome in the result.
"""


class FitmatError(Exception):
    """Any wrong input; the command line prints it as one line and exits with 1."""


class ReadError(FitmatError):
    """A file or table cannot be read as measurements."""


class ModelError(FitmatError):
    """A model name, parameter or option is not one that fitmat knows, or is out of range."""


class OutputError(FitmatError):
    """A result cannot be written where it was asked for."""


class ReadAs(UserWarning):
    """Something was given in another form than the model's; the sentence says in which convention it was read."""
