"""The command line: one thin module per command that is no stage of the pipeline."""
