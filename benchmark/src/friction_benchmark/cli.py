"""The command line of the comparison of the literature: ``friction-benchmark COMMAND``."""

import argparse
import os
import sys
from collections.abc import Sequence

from cylinder_friction.commands.cli import INTERRUPTED, REFUSALS, with_unread_output
from cylinder_friction.extras import explained
from friction_benchmark.in_the_loop import command as in_the_loop
from friction_benchmark.servo_rig import command as servo_rig

COMMANDS = {
    "run": "evaluate every model on every task and write the page; what is in the cache is not computed again",
    "inputs": "write the hashes of the code and the recordings that the benchmark uses (dvc.yaml calls this)",
    "track": "log the finished benchmark to MLflow, without duplicates",
    "summary": "print who leads each task, and where the page is",
}


def main(arguments: Sequence[str] | None = None) -> int:
    """Run one command in ``benchmark/``; returns 0, or 1 with a message where the user can do something about it."""
    return with_unread_output(lambda: _main(arguments))


def _main(arguments: Sequence[str] | None) -> int:
    options = _parser().parse_args(arguments)
    name = f"friction-benchmark {options.command}"
    try:
        with explained():
            _run(options)
    except KeyboardInterrupt:
        print(f"\n{name}: interrupted; {_kept(options.command)}", file=sys.stderr)
        return INTERRUPTED
    except Exception as error:
        if isinstance(error, BrokenPipeError) or not isinstance(error, REFUSALS):
            raise
        print(f"{name}: {error}", file=sys.stderr)
        return 1
    return 0


def _kept(command: str) -> str:
    """Return what is left after Ctrl-C, and how to go on."""
    if command == "run":
        from friction_benchmark.run import CACHE

        return f"finished jobs are kept in {CACHE}; run `friction-benchmark run` again to go on from there"
    return "nothing is half-written; run the same command again"


def _parser() -> argparse.ArgumentParser:
    parser = argparse.ArgumentParser(prog="friction-benchmark", description=__doc__)
    commands = parser.add_subparsers(dest="command", required=True)
    params = commands.add_parser("params", help="compose benchmark/conf into benchmark/params.yaml")
    params.add_argument("overrides", nargs="*", help="for example experiment=full plan.models=[low_pass,gru]")
    parsers = {name: commands.add_parser(name, help=text) for name, text in COMMANDS.items()}
    parsers["run"].add_argument("--prune", action="store_true", help="remove from the cache what this run did not use")
    servo_rig.add_arguments(commands.add_parser("servo-rig", help=servo_rig.HELP))
    in_the_loop.add_arguments(commands.add_parser("in-the-loop", help=in_the_loop.HELP))
    return parser


def _run(options: argparse.Namespace) -> None:
    if options.command == "servo-rig":
        print(servo_rig.run(options))
        return
    if options.command == "in-the-loop":
        print(in_the_loop.run(options))
        return
    from cylinder_friction.params.file import ParamsError
    from friction_benchmark import params, run

    if (params.FOLDER / params.CONF).is_dir():
        os.chdir(params.FOLDER)
    elif not params.CONF.is_dir():
        conf = params.FOLDER / params.CONF
        raise ParamsError(f"{conf}: no such folder here; run this in a checkout of cylinder-friction")
    if options.command == "params":
        params.write_benchmark_params(options.overrides)
    elif options.command == "inputs":
        run.write_inputs(params.load_benchmark_params())
    elif options.command == "run":
        print(run.run(params.load_benchmark_params(), prune=options.prune))
    else:
        print(run.track() if options.command == "track" else run.summary())


if __name__ == "__main__":
    sys.exit(main())
