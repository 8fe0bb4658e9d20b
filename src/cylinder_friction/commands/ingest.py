"""The command ``ingest init``: write a first mapping for a logger's file."""

import argparse

from cylinder_friction.files.whole_files import write_text
from cylinder_friction.recordings.formats.reading import read_logged_file
from cylinder_friction.recordings.mapping.guessing import guess_mapping
from cylinder_friction.recordings.mapping.mapping_text import mapping_yaml


def run(options: argparse.Namespace) -> None:
    if not options.file.is_file():
        raise FileNotFoundError(f"{options.file}: no such file; name a logger's file")
    guess = guess_mapping(read_logged_file(options.file, database=options.dbc), options.file)
    text = mapping_yaml(guess, options.dbc)
    if options.output is None:
        print(text, end="")
        return
    if options.output.exists():
        raise FileExistsError(f"{options.output}: is there already; name another file, or remove it first")
    write_text(options.output, text)
    print(f"{options.output}: read every line marked guess, CHECK, AMBIGUOUS or NOT FOUND")
