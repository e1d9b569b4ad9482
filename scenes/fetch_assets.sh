#!/usr/bin/env bash
# Places the real surfaces that scenes name as "asset:..." in a folder (default: build/assets of this tree).
#
# liver.inr.gz: a segmented human liver (CT) from Debian's package libcgal-demo. The package is downloaded and unpacked,
# never installed: minimal systems drop documentation folders on installation.
# bunny.obj: the Stanford bunny (public domain; 1839 particles) from the npm package `bunny`, written as OBJ by node.
# Nothing happens for a file that is there. Without apt, npm or a network the script says so and ends with 0: the demo then
# uses the project's own generated organ, and the tests of four_bunnies.yaml are skipped.
set -euo pipefail

root=$(cd "$(dirname "${BASH_SOURCE[0]}")/.." && pwd)
destination=${1:-$root/build/assets}
mkdir -p "$destination"
destination=$(cd "$destination" && pwd)
scratch=$(mktemp -d)
trap 'rm -rf "$scratch"' EXIT
chmod 755 "$scratch"  # apt downloads as another user where it can

say() { echo "fetch_assets: $*" >&2; }

# missing FILE REASON
missing() { say "$1 cannot be had ($2); scenes that name asset:$1 will not load"; }

# place FILE: from the scratch folder, in one step: an interrupted run leaves no half file.
place() {
  cp "$scratch/$1" "$destination/$1.part"
  mv "$destination/$1.part" "$destination/$1"
  say "placed $destination/$1"
}

download_liver() { (cd "$scratch" && timeout 300 apt-get download -q libcgal-demo) > "$scratch/log" 2>&1; }

fetch_liver() {
  command -v apt-get > /dev/null && command -v dpkg-deb > /dev/null || { missing liver.inr.gz "no apt-get here"; return; }
  if ! download_liver; then
    # Fresh systems have no package lists yet.
    timeout 300 apt-get update -q > "$scratch/log" 2>&1 || true
    download_liver || {
      missing liver.inr.gz "apt-get download libcgal-demo failed: $(grep -m1 '^E:' "$scratch/log" || tail -n 1 "$scratch/log")"
      return
    }
  fi
  dpkg-deb -x "$scratch"/libcgal-demo_*.deb "$scratch/package" &&
    tar -xzf "$scratch/package/usr/share/doc/libcgal-dev/data.tar.gz" -C "$scratch" \
      --transform='s|.*/||' data/images/liver.inr.gz ||
    { missing liver.inr.gz "the package does not hold data/images/liver.inr.gz"; return; }
  place liver.inr.gz
}

fetch_bunny() {
  command -v npm > /dev/null && command -v node > /dev/null || { missing bunny.obj "no npm here"; return; }
  (cd "$scratch" && timeout 300 npm pack --silent bunny@1.0.1 && tar -xzf bunny-1.0.1.tgz package/index.js) \
    > "$scratch/log" 2>&1 || { missing bunny.obj "npm pack bunny failed: $(tail -n 1 "$scratch/log")"; return; }
  node -e '
    const bunny = require(process.argv[1]);
    const lines = bunny.positions.map((p) => "v " + p.join(" "));
    lines.push(...bunny.cells.map((c) => "f " + c.map((i) => i + 1).join(" ")));
    process.stdout.write(lines.join("\n") + "\n");
  ' "$scratch/package/index.js" > "$scratch/bunny.obj" || { missing bunny.obj "node cannot read the package"; return; }
  place bunny.obj
}

[[ -s $destination/liver.inr.gz ]] || fetch_liver
[[ -s $destination/bunny.obj ]] || fetch_bunny
