#!/usr/bin/env bash
# Each line of tests/mutations.txt must still change its file: a bug that is no longer planted looks caught to a reader.
set -euo pipefail
cd "$(dirname "${BASH_SOURCE[0]}")/../.."

# stale FILE: its lines that change nothing.
stale() {
  local line file expression number=0
  while IFS= read -r line; do
    number=$((number + 1))
    case "$line" in '' | '#'*) continue ;; esac
    file=${line%% | *} expression=${line#* | } expression=${expression% | *}
    if [ -f "$file" ] && sed -E "$expression" "$file" >"$mutant" 2>/dev/null && ! cmp -s "$mutant" "$file"; then
      continue
    fi
    echo "$1:$number: error: changes nothing in $file: $expression"
  done <"$1"
}

planted=$(mktemp) mutant=$(mktemp)
trap 'rm -f "$planted" "$mutant"' EXIT
printf '%s\n' 'dev | s/^set -e/set -x/ | a' 'dev | s/nothing like this/x/ | a' 'no/such/file | s/a/b/ | a' 'dev | s/a/ | a' >"$planted"
if [ "$(stale "$planted" | wc -l)" != 3 ]; then
  echo "check_mutations.sh: does not find what was planted" >&2
  exit 1
fi

found=$(stale tests/mutations.txt)
[ -z "$found" ] && exit 0
printf '%s\n' "$found" >&2
exit 1
