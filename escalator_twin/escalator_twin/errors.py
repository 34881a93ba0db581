"""Errors that are the user's to mend; every message names what, where, expected and found."""


class EscalatorError(Exception):
    """Any mistake in the input; shells print it as one line and exit with status 2."""


class MachineError(EscalatorError):
    """A machine description is wrong; the message gives file and key."""


class ExperimentError(EscalatorError):
    """An experiment's settings are wrong; the message gives the key."""


class BagError(EscalatorError):
    """A recording's container cannot be read; the message gives the file."""


class RecordingError(EscalatorError):
    """A recording can be read but lacks what a question needs; the message gives the topic."""


class SynchronisationError(EscalatorError):
    """Place or speed cannot be known from the signals at hand."""


class NotYetError(EscalatorError):
    """Something documented that this version does not do."""
