#!/bin/sh
# follow_page.sh PAGE PREFIX WORK: does what the page says, to the letter, in the empty folder WORK.
# A block after <!-- file: NAME --> is saved as NAME; a block after <!-- run --> is run. The page's ~/diracstep
# is PREFIX, and its command is on the path.
set -eu
page="$1" prefix="$2" work="$3"
rm -rf "$work"
mkdir -p "$work/home"
ln -s "$prefix" "$work/home/diracstep"
cd "$work"
awk '
  /^<!-- file: /         { target = $3; next }
  /^<!-- run -->/        { target = "run.sh"; next }
  /^```/ && open         { open = 0; target = ""; next }
  /^```/ && target != "" { open = 1; next }
  open                   { print > target }
' "$page"
HOME="$work/home" PATH="$work/home/diracstep/bin:$PATH"
export HOME PATH
test "$(wc -l <run.sh)" -ge 5
sh -ex run.sh
test -s knife_edge.csv
