#!/bin/sh
# check_rooms.sh ROOT [TABLE]: whether every include of the libraries and the command in ROOT is one that the table of
# rooms allows, every folder with sources is a room of it with a README.md, and none is too full.  Prints every fault.
set -eu
tests="$(cd "$(dirname "$0")" && pwd)"
table="${2:-$tests/rooms.txt}"
folders="$(sed -n 's/^\([a-z_]*\)[/:].*/\1/p' "$table" | sort -u)"
cd "$1"
for folder in tests bench; do [ ! -d "$folder" ] || others="${others:-} $folder"; done
sources() { find "$@" '(' -name '*.[ch]' -o -name '*.[ch]pp' ')' -type f; }
{
  sources $folders ${others:-} | sed 's/^/file /'
  find $folders -name README.md -exec awk 'END { print "readme", NR, FILENAME }' {} ';'
  sources $folders | xargs grep -H '^[[:space:]]*#[[:space:]]*include' | sed 's/^/include /'
} | awk -f "$tests/check_rooms.awk" "$table" -
