#!/usr/bin/env python3
"""bench_scenes.py PROGRAM [--json FILE]: how long a step of each scene takes on this machine, on one thread.

The scenes are run in turn, several rounds over, so that a slow minute of the machine falls on all of them. Of the rounds
the best median counts (others measure what else the machine was doing); the spread over the rounds is printed beside it.
"""

import argparse
import glob
import json
import os
import subprocess
import sys

ROUNDS = 3
SECONDS = "3"         # simulated
MEASURE_FROM = "1"    # simulated: contacts have formed


def complain(text):
    print(f"bench: {text}", file=sys.stderr)


def loads(program, scene):
    """Whether the scene can be loaded here; says why not (an asset that set-up did not fetch)."""
    result = subprocess.run([program, "scene", "check", scene], capture_output=True, text=True, check=False)
    if result.returncode != 0:
        reason = (result.stderr or result.stdout).strip().splitlines()
        complain(f"left out: {reason[0] if reason else scene}")
    return result.returncode == 0


def run(program, scene):
    command = [program, "run", scene, "--seconds", SECONDS, "--measure-from", MEASURE_FROM, "--threads", "1", "--json"]
    result = subprocess.run(command, stdout=subprocess.PIPE, text=True, check=False)
    if result.returncode != 0:
        complain(f"{scene} ended with {result.returncode}")
        sys.exit(1)
    return json.loads(result.stdout)


def summary(scene, runs):
    best = min(runs, key=lambda r: r["cpu_ms_per_step"]["median"])
    medians = [r["cpu_ms_per_step"]["median"] for r in runs]
    return {
        "scene": scene,
        "particles": best["particles"],
        "triangles": best["triangles"],
        "dt_s": best["dt_s"],
        "cpu_ms_per_step": best["cpu_ms_per_step"],
        "wall_ms_per_step": best["wall_ms_per_step"],
        "slowest_round_over_best": max(medians) / min(medians) if min(medians) > 0 else 1.0,
        "state_hash": best["state_hash"],
    }


def main():
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0])
    parser.add_argument("program")
    parser.add_argument("--json", metavar="FILE")
    arguments = parser.parse_args()

    scenes = sorted(glob.glob("scenes/paper/*.yaml") + glob.glob("scenes/training/*.yaml"))
    scenes = [scene for scene in scenes if loads(arguments.program, scene)]
    if not scenes:
        complain("no scene to run")
        return 1
    runs = {scene: [] for scene in scenes}
    for number in range(ROUNDS):
        for scene in scenes:
            complain(f"round {number + 1} of {ROUNDS}: {scene}")
            runs[scene].append(run(arguments.program, scene))

    results = [summary(scene, runs[scene]) for scene in scenes]
    print(f"{'scene':40} {'particles':>9} {'median ms':>10} {'p99 ms':>10} {'of real time':>13} {'spread':>7}")
    for r in results:
        cpu = r["cpu_ms_per_step"]
        print(f"{r['scene']:40} {r['particles']:9d} {cpu['median']:10.4f} {cpu['p99']:10.4f} "
              f"{cpu['median'] / 1000 / r['dt_s']:13.3f} {r['slowest_round_over_best']:7.2f}")
    if arguments.json:
        with open(arguments.json, "w", encoding="utf-8") as file:
            json.dump({"cores": os.cpu_count(), "rounds": ROUNDS, "scenes": results}, file, indent=2)
            file.write("\n")
    return 0


if __name__ == "__main__":
    sys.exit(main())
