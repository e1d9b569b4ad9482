#!/usr/bin/env bash
# tidy.sh JOBS [--all]: clang-tidy over the sources of core/, and over those of server/ and clients/ that differ from the
# main branch (gRPC's headers make them slow). A source whose preprocessed text and settings are those of a clean run is skipped, unless --all is given.
set -euo pipefail
cd "$(dirname "${BASH_SOURCE[0]}")/../.."
jobs=$1
again=${2:-}
readonly BUILD=build/release STAMPS=build/tidy
mkdir -p "$STAMPS"

# Sources include generated messages. Each target exists once the folder behind it does.
mapfile -t targets < <(cmake --build "$BUILD" --target help | sed -nE 's/^(adhesim_(service_)?proto): phony$/\1/p')
cmake --build "$BUILD" -j "$jobs" --target "${targets[@]}" >/dev/null

# The point where this branch left main, if there is a main to compare with.
base=$(git merge-base HEAD origin/main 2>/dev/null || git merge-base HEAD main 2>/dev/null || echo HEAD)
mapfile -t sources < <(
  {
    git ls-files --cached --others --exclude-standard -- 'core/*.cc'
    git diff --name-only --diff-filter=d "$base" -- 'server/*.cc' 'clients/*.cc'
    git ls-files --others --exclude-standard -- 'server/*.cc' 'clients/*.cc'
  } | sort -u)

# command_of SOURCE: how the build compiles it; empty when it does not (an effect switched off, a sanitizer's test).
command_of() {
  python3 - "$1" <<'PY'
import json, os, re, sys
for entry in json.load(open("build/release/compile_commands.json")):
    if os.path.realpath(entry["file"]) == os.path.realpath(sys.argv[1]):
        # Preprocess instead: the same words without "ccache", "-c FILE" and "-o FILE".
        words = re.sub(r" -o \S+| -c (?=\S)", " ", entry["command"])
        print("cd '%s' && %s -E -P" % (entry["directory"], re.sub(r"^\S*ccache ", "", words)))
        break
PY
}

tidy_one() {
  local source=$1 command key stamp
  command=$(command_of "$source")
  [ -n "$command" ] || return 0
  stamp=$STAMPS/${source//\//_}
  # Comments (NOLINT among them) are not in the preprocessed text: the files of this project count as they are.
  key=$({ bash -c "$command" && cat .clang-tidy "$source" && clang-tidy-16 --version; } 2>/dev/null | sha256sum)
  if [ -z "$again" ] && [ "$(cat "$stamp" 2>/dev/null)" = "$key" ]; then return 0; fi
  if clang-tidy-16 --quiet -p "$BUILD" "$source" 2> >(grep -vE 'warnings? (generated|treated)|^$|^Suppressed' >&2); then
    printf '%s\n' "$key" >"$stamp"
  else
    rm -f "$stamp"
    return 1
  fi
}
export -f tidy_one command_of
export BUILD STAMPS again

[ ${#sources[@]} -gt 0 ] || exit 0
printf '%s\0' "${sources[@]}" | xargs -0 -P "$jobs" -I{} bash -c 'tidy_one "$1"' _ {}
