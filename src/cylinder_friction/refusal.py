"""The base of every error whose message is all that a user needs: what is wrong, where, and what to do."""


class RefusalError(Exception):
    """Work was refused. A command prints the message without a traceback and ends with status 1."""
