#!/usr/bin/env bash
# Places the real organs that scenes name as "asset:..." in a folder (default: build/assets of this tree).
#
# liver.inr.gz: a segmented human liver (CT) from Debian's package libcgal-demo. The package is downloaded and unpacked,
# never installed: minimal systems drop documentation folders on installation. Nothing happens when the file is there.
# Without apt or a network the script says so and ends with 0: the demo then uses the project's own generated organ.
set -euo pipefail

root=$(cd "$(dirname "${BASH_SOURCE[0]}")/.." && pwd)
destination=${1:-$root/build/assets}
liver=$destination/liver.inr.gz

say() { echo "fetch_assets: $*" >&2; }

[[ -s $liver ]] && exit 0

give_up() {
  say "the real liver cannot be had ($1); scenes that name asset:liver.inr.gz will not load"
  exit 0
}

command -v apt-get > /dev/null && command -v dpkg-deb > /dev/null || give_up "no apt-get here"
mkdir -p "$destination"
scratch=$(mktemp -d)
trap 'rm -rf "$scratch"' EXIT
chmod 755 "$scratch"  # apt downloads as another user where it can

download() { (cd "$scratch" && timeout 300 apt-get download -q libcgal-demo) > "$scratch/log" 2>&1; }
if ! download; then
  # Fresh systems have no package lists yet.
  timeout 300 apt-get update -q > "$scratch/log" 2>&1 || true
  download || give_up "apt-get download libcgal-demo failed: $(grep -m1 '^E:' "$scratch/log" || tail -n 1 "$scratch/log")"
fi

dpkg-deb -x "$scratch"/libcgal-demo_*.deb "$scratch/package" || give_up "the package cannot be unpacked"
tar -xzf "$scratch/package/usr/share/doc/libcgal-dev/data.tar.gz" -C "$scratch" data/images/liver.inr.gz \
  || give_up "the package does not hold data/images/liver.inr.gz"
# Moved into place in one step: an interrupted run leaves no half file.
cp "$scratch/data/images/liver.inr.gz" "$liver.part"
mv "$liver.part" "$liver"
say "placed $liver"
