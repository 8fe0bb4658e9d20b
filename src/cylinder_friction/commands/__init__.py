"""The commands of the command line that are not stages, one thin module each."""
