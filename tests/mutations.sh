#!/usr/bin/env bash
# mutations.sh [REGEX]: plants each bug of tests/mutations.txt in a scratch copy, builds the tests that the line names, and
# demands that one fails. Called by ./dev mutations. Environment: JOBS, parallel compile jobs.
set -euo pipefail
cd "$(dirname "${BASH_SOURCE[0]}")/.."
readonly ROOT=$PWD COPY=$PWD/build/mutations/source BUILD=$PWD/build/mutations/source/build/release
readonly JOBS=${JOBS:-$(nproc)} WANTED=${1:-}
readonly LOG=build/mutations/log
export CCACHE_BASEDIR=$COPY CCACHE_NOHASHDIR=1

# The scratch copy keeps times, so that the build of an earlier run is used again.
refresh_copy() {
  mkdir -p "$COPY"
  local file
  while IFS= read -r -d '' file; do
    [ -f "$file" ] || continue
    cmp -s "$file" "$COPY/$file" || cp -p --parents "$file" "$COPY"
  done < <(git ls-files -z --cached --others --exclude-standard)
  # What the repository no longer has must not be built.
  (cd "$COPY" && find . -path ./build -prune -o -type f -printf '%P\0') |
    while IFS= read -r -d '' file; do [ -e "$file" ] || rm "$COPY/$file"; done
}

# programs_of REGEX: the build targets of the tests that match.
programs_of() {
  local path
  ctest --test-dir "$BUILD" -R "$1" --show-only=json-v1 | grep -oE "\"$BUILD/[^\"]+\"" | tr -d '"' | sort -u |
    while IFS= read -r path; do [ ! -f "$path" ] || basename "$path"; done
}

run_tests() { ctest --test-dir "$BUILD" -R "$1" --no-tests=error --timeout 300 -j "$JOBS" >>"$LOG" 2>&1; }

build() { cmake --build "$BUILD" -j "$JOBS" --target "$@" >>"$LOG" 2>&1; }

# plant FILE EXPRESSION TESTS: 0 the bug was caught, 1 it survived, 2 the line is wrong.
plant() {
  local file=$1 expression=$2 tests=$3 programs
  [ -f "$COPY/$file" ] || { echo "no such file"; return 2; }
  mapfile -t programs < <(programs_of "$tests")
  [ ${#programs[@]} -gt 0 ] || { echo "no test matches"; return 2; }
  run_tests "$tests" || { echo "the tests fail without the bug"; return 2; }
  sed -E -i "$expression" "$COPY/$file" || { echo "sed refuses the expression"; return 2; }
  if cmp -s "$file" "$COPY/$file"; then echo "the expression changes nothing"; return 2; fi
  if ! build "${programs[@]}"; then echo "does not compile"; return 2; fi
  if run_tests "$tests"; then echo "SURVIVED"; return 1; fi
  echo "caught"
}

refresh_copy
: >"$LOG"
# Everything once, unharmed, so that ctest knows every test.
if ! (cd "$COPY" && cmake --preset release) >>"$LOG" 2>&1 || ! build all; then
  tail -30 "$LOG" >&2
  echo "mutations: the unharmed copy does not build" >&2
  exit 1
fi

caught=0 survived=0 wrong=0 number=0
while IFS= read -r line; do
  number=$((number + 1))
  case "$line" in '' | '#'*) continue ;; esac
  if [ -n "$WANTED" ] && ! [[ "$line" =~ $WANTED ]]; then continue; fi
  file=${line%% | *} tests=${line##* | }
  expression=${line#* | } expression=${expression% | *}
  printf 'tests/mutations.txt:%d: %s: %s: ' "$number" "$file" "$expression"
  status=0
  plant "$file" "$expression" "$tests" </dev/null || status=$?
  case $status in 0) caught=$((caught + 1)) ;; 1) survived=$((survived + 1)) ;; *) wrong=$((wrong + 1)) ;; esac
  # Undo; the new time makes the next build compile it again.
  if [ -f "$file" ] && ! cmp -s "$file" "$COPY/$file"; then cp "$ROOT/$file" "$COPY/$file"; fi
  mapfile -t programs < <(programs_of "$tests")
  [ ${#programs[@]} = 0 ] || build "${programs[@]}" || true
done <tests/mutations.txt

echo "$caught caught, $survived survived, $wrong wrong lines"
[ $((survived + wrong)) = 0 ] && [ "$caught" -gt 0 ]
