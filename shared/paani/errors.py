"""The one exception that the command line turns into a line and exit code 2."""


class UserError(Exception):
    """A mistake of the user's: one line that names the setting, file or device at fault."""
