#!/usr/bin/env bash
# No file of the repository may name a place that exists on one machine only (a home or work folder, a package
# registry's address), or carry a leftover of a merge. Shows that it finds planted ones first.
set -euo pipefail
cd "$(dirname "${BASH_SOURCE[0]}")/../.."

# Brackets keep the patterns from matching themselves.
readonly PATTERNS=(
  '(^|[^A-Za-z0-9_.$}/-])/([w]ork|[h]ome|[r]oot|[U]sers|[t]mp/wt)/'
  '([r]egistry\.npmjs|[r]egistry\.yarnpkg|[p]ypi\.|[f]iles\.pythonhosted|[p]roxy\.golang|[i]ndex\.crates|[r]ubygems\.)'
  '([d]eb|[s]napshot|[s]ecurity)\.debian\.org'
  '^(<<<<<<<|>>>>>>>) '
)

found_in() { # found_in FILE...: prints the offending lines
  local pattern
  for pattern in "${PATTERNS[@]}"; do grep -InHE -e "$pattern" -- "$@" || true; done
}

planted=$(mktemp)
trap 'rm -f "$planted"' EXIT
printf '%s\n' 'path = "/''work/x"' 'cd /''home/someone/x' 'https://registry''.npmjs.org/a' \
  'http://deb''.debian.org/debian' '<<<<<<''< HEAD' '>>>>>>''> other' >"$planted"
if [ "$(found_in "$planted" | wc -l)" != 6 ]; then
  echo "check_text.sh: does not find what was planted" >&2
  exit 1
fi

mapfile -d '' -t files < <(git ls-files -z --cached --others --exclude-standard)
existing=()
for file in "${files[@]}"; do [ -f "$file" ] && existing+=("$file"); done
problems=$(found_in "${existing[@]}")
[ -z "$problems" ] && exit 0
printf '%s\n' "$problems" >&2
exit 1
