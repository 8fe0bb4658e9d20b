"""Readers of loggers' files, one per format, chosen by what a file holds and not by its ending."""
