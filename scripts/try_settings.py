"""Solves the development sequences with settings of the configuration, and prints a table of errors: how a default is chosen.

Usage: try_settings.py [--frames 11] [--folder out/development] SETTING... A SETTING is what `solve --set` takes, several with spaces
between; the defaults come first by themselves. Every sequence is solved from its simulated input and from what `prepare` makes of its
pictures. A row holds means over the sequences, from simulated input / from pictures; seconds are CPU seconds of hypotheses, main solve
and free form. What is in the folder is not made again, solves excepted that another build made. Needs `cargo build --release`, and
data/README.md's packages.
"""

import argparse
import hashlib
import json
import os
import subprocess
from concurrent.futures import ThreadPoolExecutor
from pathlib import Path
from statistics import mean

PROGRAM = Path("target/release/spba-ceres")
INPUTS = ["simulated", "pictures"]
COLUMNS = {
    "depth error": lambda result: f"{result['depth_error']:.4f}",
    "at the best scale": lambda result: f"{result['depth_error_at_best_scale']:.4f}",
    "location error": lambda result: f"{result['location_error_percent']:.2f}",
    "orientation error": lambda result: f"{result['orientation_error_deg']:.2f}",
    "silhouette IoU": lambda result: f"{result['silhouette_iou_mean']:.3f}",
    "Chamfer": lambda result: f"{result['chamfer_percent']:.2f}",
    "seconds": lambda result: f"{result['cpu_seconds']:.1f}",
}


def run(*arguments):
    # One thread each: as many runs go on at once as there are cores, and CPU seconds mean the same in each.
    environment = dict(os.environ, RAYON_NUM_THREADS="1")
    done = subprocess.run([PROGRAM, *map(str, arguments)], capture_output=True, text=True, env=environment)
    if done.returncode != 0:
        raise SystemExit(f"{' '.join(map(str, done.args))}\n{done.stdout}{done.stderr}")
    return done.stdout


def prepared(folder, frames):
    """The prior, and folders of the rendered sequences; made where they are missing."""
    prior = folder / "prior.safetensors"
    if not prior.exists():
        run("prior", "learn", "--sources", "data/priors/development.toml", "--template", "data/priors/templates/car.obj",
            "--styles", 32, "--out", prior)
    rendered = folder / "simulated"
    run("render", "--benchmark", "data/benchmarks/development.toml", "--frames", frames, "--out", rendered)
    sequences = sorted(rendered.glob(f"*-{frames}"))
    for sequence in sequences:
        pictures = folder / "pictures" / sequence.name
        if not pictures.exists():
            run("prepare", sequence / "images", "--masks", sequence / "masks", "--focal", 600, "--out", pictures)
    return prior, sequences


def solved(folder, build, setting, kind, sequence, prior):
    """Errors of one solve; a solve that says its result is not usable counts as well."""
    name = hashlib.sha256(json.dumps([build, setting]).encode()).hexdigest()[:12]
    out = folder / "results" / name / kind / sequence.name
    if not (out / "result.json").exists():
        changes = [part for change in setting for part in ("--set", change)]
        arguments = ["solve", folder / kind / sequence.name, "--prior", prior, "--out", out, *changes]
        environment = dict(os.environ, RAYON_NUM_THREADS="1")
        done = subprocess.run([PROGRAM, *map(str, arguments)], capture_output=True, text=True, env=environment)
        if not (out / "result.json").exists():
            raise RuntimeError(done.stderr.strip().splitlines()[-1])
    errors = json.loads(run("eval", out, "--truth", sequence, "--json"))["result"]
    seconds = json.loads((out / "result.json").read_text())["seconds"]
    return {
        key: errors[key] for key in ("depth_error", "depth_error_at_best_scale", "silhouette_iou_mean", "chamfer_percent")
    } | {
        key: errors[key]["mean"] for key in ("location_error_percent", "orientation_error_deg")
    } | {"cpu_seconds": sum(value for stage, value in seconds.items() if stage.endswith("_cpu"))}


def main():
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("--frames", type=int, default=11)
    parser.add_argument("--folder", type=Path, default=Path("out/development"))
    parser.add_argument("settings", nargs="*")
    arguments = parser.parse_args()
    prior, sequences = prepared(arguments.folder, arguments.frames)
    build = hashlib.sha256(PROGRAM.read_bytes()).hexdigest()
    print("| | " + " | ".join(COLUMNS) + " |")
    print("|---" * (len(COLUMNS) + 1) + "|", flush=True)
    with ThreadPoolExecutor(len(os.sched_getaffinity(0))) as pool:
        rows = []
        for setting in ["", *arguments.settings]:
            changes = setting.split()
            rows.append((setting or "defaults", {
                kind: [pool.submit(solved, arguments.folder, build, changes, kind, sequence, prior) for sequence in sequences]
                for kind in INPUTS
            }))
        for name, of_kind in rows:
            means = []
            try:
                for kind in INPUTS:
                    results = [future.result() for future in of_kind[kind]]
                    means.append({key: mean(result[key] for result in results) for key in results[0]})
            except RuntimeError as error:
                print(f"| {name} | {error} |", flush=True)
                continue
            cells = [" / ".join(form(result) for result in means) for form in COLUMNS.values()]
            print(f"| {name} | " + " | ".join(cells) + " |", flush=True)


if __name__ == "__main__":
    main()
