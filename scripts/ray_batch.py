"""Solves a list of sequences (`spba-ceres batch --help`) on Ray, one task a sequence, and prints the table.

Usage: ray_batch.py LIST.toml OUT [--address ADDRESS] [--cpus N] [--program PATH]. LIST and OUT must be visible on all
nodes. Run again it goes on with what has no result yet. Needs: pip install ray.
"""

import argparse
import shutil
import subprocess
import sys
from pathlib import Path

import ray


def parsed():
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("list", type=Path)
    parser.add_argument("out", type=Path)
    parser.add_argument("--address", help="of a cluster that runs; without it one is started on this machine")
    parser.add_argument("--cpus", type=float, default=1, help="of a node that one solve takes")
    parser.add_argument("--program", default="spba-ceres", help="spba-ceres, on all nodes")
    return parser.parse_args()


def main():
    arguments = parsed()
    program = shutil.which(arguments.program)
    if program is None:
        sys.exit(f"{arguments.program}: no such program; name it with --program")
    batch = [str(Path(program).resolve()), "batch", str(arguments.list.resolve()), "--out", str(arguments.out.resolve())]
    listed = subprocess.run([*batch, "--names"], capture_output=True, text=True)
    if listed.returncode:
        sys.exit(listed.stderr.strip())
    names = listed.stdout.split("\n")[:-1]
    ray.init(address=arguments.address, log_to_driver=False)

    # A solve that fails is in the table; a node that is lost is Ray's to replace.
    @ray.remote(num_cpus=arguments.cpus, max_retries=3)
    def solve(index):
        return subprocess.run([*batch, "--only", str(index)], capture_output=True, text=True).stderr.strip()

    running = {solve.remote(index): name for index, name in enumerate(names)}
    while running:
        [done], _ = ray.wait(list(running), num_returns=1)
        print(f"{running.pop(done)}: {ray.get(done)}", file=sys.stderr)
    ray.shutdown()
    sys.exit(subprocess.run([*batch, "--summary"]).returncode)


if __name__ == "__main__":
    main()
