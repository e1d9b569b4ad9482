#!/usr/bin/env python3
"""tidy.py JOBS [--all]: clang-tidy over the sources of core/, and over those of server/ and clients/ that differ from the main
branch (gRPC's headers make them slow).

Nearly all the time goes into parsing and walking the headers of Eigen and Protobuf. So sources that are compiled with the
same options are analysed several at a time, as one translation unit that includes them. Sources whose private names collide
do not compile together: such a unit is halved, down to single sources. A unit whose preprocessed text is that of an earlier
clean run is skipped, unless --all is given.
"""

import concurrent.futures
import hashlib
import json
import os
import shlex
import subprocess
import sys

ROOT = os.getcwd()
BUILD = "build/release"
SCRATCH = os.path.join(ROOT, "build/tidy")
TIDY = "clang-tidy-16"
SOURCES_A_UNIT = 6


def output_of(*command):
    return subprocess.run(command, capture_output=True, text=True, check=False).stdout


def compile_options():
    """{source: options} of every source that the release build compiles; sources relative to the root."""
    with open(f"{BUILD}/compile_commands.json", encoding="utf-8") as file:
        entries = json.load(file)
    options = {}
    for entry in entries:
        words = shlex.split(entry["command"])
        first = next(i for i, word in enumerate(words) if word.startswith("-"))
        words = words[first:]
        for flag in ("-o", "-c"):
            at = words.index(flag)
            del words[at:at + 2]
        options[os.path.relpath(entry["file"], ROOT)] = tuple(words)
    return options


def wanted_sources():
    listing = ["git", "ls-files", "--cached", "--others", "--exclude-standard", "--"]
    sources = set(output_of(*listing, "core/*.cc").split())
    base = (output_of("git", "merge-base", "HEAD", "origin/main") or output_of("git", "merge-base", "HEAD", "main")
            or "HEAD").strip()
    others = ["server/*.cc", "clients/*.cc"]
    sources.update(output_of("git", "diff", "--name-only", "--diff-filter=d", base, "--", *others).split())
    sources.update(output_of("git", "ls-files", "--others", "--exclude-standard", "--", *others).split())
    return sorted(sources)


def units_of(sources, options):
    """Lists of sources that share their options."""
    by_options = {}
    for source in sources:
        if source in options:   # others are switched off in this build
            by_options.setdefault(options[source], []).append(source)
    for words, group in by_options.items():
        for i in range(0, len(group), SOURCES_A_UNIT):
            yield group[i:i + SOURCES_A_UNIT], words


def analyse(sources, words, again):
    """Findings of one unit as text; empty when clean."""
    text = "".join(f'#include "{os.path.join(ROOT, source)}"\n' for source in sources)
    unit = os.path.join(SCRATCH, hashlib.sha256(text.encode()).hexdigest()[:16] + ".cc")
    with open(unit, "w", encoding="utf-8") as file:
        file.write(text)

    # Comments (NOLINT) are lost in preprocessing: the sources count as they are, too.
    key = hashlib.sha256(output_of("g++", *words, "-E", "-P", unit).encode())
    for path in [".clang-tidy", *sources]:
        with open(path, "rb") as file:
            key.update(file.read())
    stamp = os.path.join(SCRATCH, key.hexdigest())
    known = ""
    if os.path.exists(stamp) and not again:
        with open(stamp, encoding="utf-8") as file:
            known = file.read()
    if known == "clean":
        return ""

    if known != "split":
        # The sources are included here, hence "headers", and that is no mistake.
        result = subprocess.run(
            [TIDY, "--quiet", "--checks=-bugprone-suspicious-include",
             rf"--header-filter=^{ROOT}/(core|server|clients)/.*\.(h|cc)$", unit, "--", *words],
            capture_output=True, text=True, check=False)
        known = "clean"
        if result.returncode != 0:
            if len(sources) == 1 or "clang-diagnostic-error" not in result.stdout:
                return result.stdout or result.stderr
            known = "split"
        with open(stamp, "w", encoding="utf-8") as file:
            file.write(known)
    if known == "clean":
        return ""
    half = len(sources) // 2
    return analyse(sources[:half], words, again) + analyse(sources[half:], words, again)


def main():
    jobs, again = sys.argv[1], "--all" in sys.argv[2:]
    # Sources include generated messages.
    targets = [line.split(":")[0] for line in output_of("cmake", "--build", BUILD, "--target", "help").splitlines()
               if line in ("adhesim_proto: phony", "adhesim_service_proto: phony")]
    subprocess.run(["cmake", "--build", BUILD, "-j", jobs, "--target", *targets], stdout=subprocess.DEVNULL, check=True)
    os.makedirs(SCRATCH, exist_ok=True)
    units = list(units_of(wanted_sources(), compile_options()))
    failed = False
    with concurrent.futures.ThreadPoolExecutor(int(jobs)) as pool:
        for findings in pool.map(lambda unit: analyse(*unit, again), units):
            if findings:
                failed = True
                print(findings, file=sys.stderr)
    return 1 if failed else 0


if __name__ == "__main__":
    sys.exit(main())
