"""Readers of loggers' files, one a format, chosen by what a file holds and not by its ending."""
