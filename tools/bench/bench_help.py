"""Times `sphmctl --help` beside the --help of a typer application with two empty commands.

Run `python tools/bench/bench_help.py`; each call is a new process, the two taking turns.
"""

from __future__ import annotations

import argparse
import statistics
import subprocess
import sys
import time

from tools.bench.harness import SPHMCTL, Row, markdown

COMMAND = "python tools/bench/bench_help.py"
CALLS = 15
CALL_LIMIT_S = 60.0

BARE = """
import typer
app = typer.Typer()
@app.command()
def one(number: int = 1) -> None:
    "The first."
@app.command()
def two(number: int = 1) -> None:
    "The second."
app()
"""


def call_s(command: list[str]) -> float:
    """How long a process takes, start to end."""
    started = time.perf_counter()
    subprocess.run(command, stdout=subprocess.DEVNULL, check=True, timeout=CALL_LIMIT_S)
    return time.perf_counter() - started


def measure(calls: int = CALLS) -> list[Row]:
    """Call both in turns; prints the medians, returns the table's row."""
    ours, bare = [SPHMCTL, "--help"], [sys.executable, "-c", BARE, "--help"]
    for command in (ours, bare):
        call_s(command)  # the first ones read files that are not in memory yet
    pairs = [(call_s(ours), call_s(bare)) for _ in range(calls)]
    own_s, bare_s = (statistics.median(column) for column in zip(*pairs, strict=True))
    print(f"--help, s, median of {calls}: sphmctl {own_s:.3f}, bare typer {bare_s:.3f}", flush=True)
    return [
        Row(
            "sphmctl --help",
            f"{own_s:.2f} s",
            f"{bare_s:.2f} s, bare typer",
            own_s / bare_s,
            None,
            COMMAND,
        )
    ]


def main() -> None:
    """Print the figures and the row."""
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("--calls", type=int, default=CALLS, help="calls of each")
    print(markdown(measure(parser.parse_args().calls)))


if __name__ == "__main__":
    main()
