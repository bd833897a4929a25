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


class Doubt(UserWarning):
    """What was read is taken as it is, though it may not be meant; the sentence says what it is."""


def exhausted(error: BaseException) -> str:
    """What the machine had too little of, as a sentence; empty where the error is another one.

    XLA says of memory that it is "RESOURCE_EXHAUSTED", Python of threads that it "can't start" one.
    """
    if isinstance(error, MemoryError) or "RESOURCE_EXHAUSTED" in str(error):
        return "there is not enough memory; take fewer models or rows at once, or a machine with more."
    if "can't start new thread" in str(error):
        got = "the machine grants no more threads to this user"
        return f"{got}, expected some tens. End other programs, or raise the limit of processes (ulimit -u)."
    return ""
