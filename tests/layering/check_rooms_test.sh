#!/bin/sh
# check_rooms_test.sh WORK: whether check_rooms.sh refuses what the table forbids.  In a tree of empty rooms, each room
# includes each other room and library once, and what is refused must be what the table does not name; then comes one
# fault of every other kind.
set -eu
tests="$(cd "$(dirname "$0")" && pwd)"
table="$tests/rooms.txt" work="$1"
rooms="$(sed -n 's/^\([a-z_/]*\):.*/\1/p' "$table")"
headers="Eigen/Core=Eigen sundials/sundials_context.h=SUNDIALS ida/ida.h=SUNDIALS klu.h=KLU Spectra/GenEigsSolver.h=Spectra
  fmt/format.h=fmt
  toml++/toml.h=toml++ CLI/App.hpp=CLI11 nlohmann/json.hpp=nlohmann gtest/gtest.h=GoogleTest"
failures=0
fail() { echo "$*"; failures=1; }

empty_tree() {
  rm -rf "$work"
  for room in $rooms solvers/detail; do
    mkdir -p "$work/$room"
    echo '#pragma once' >"$work/$room/unit.hpp"
    echo "# $room" >"$work/$room/README.md"
  done
}
check() { "$tests/check_rooms.sh" "$work" "$@"; }

# The rooms and libraries that a line of the table names, "core" written out.
allowed_for() {
  for name in $(sed -n "s|^$1:||p" "$table"); do
    case "$name" in core | validation) echo "$rooms" | grep "^$name/" ;; *) echo "$name" ;; esac
  done
}

# Every pair of the table: one source of the room includes all others.
empty_tree
check || fail "the tree without faults is refused"
for room in $rooms; do
  for other in $rooms solvers/detail; do echo "#include <diracstep/$other/unit.hpp>"; done >"$work/$room/planted.cpp"
  for header in $headers; do echo "#include <${header%=*}>"; done >>"$work/$room/planted.cpp"
  check | sed -n "s|^$room/planted.cpp: $room must not include \([^ ]*\) .*|\1|p" | sort -u >"$work/refused" || true
  { echo "$room"; [ "$room" != solvers ] || echo solvers/detail; allowed_for "$room"; } | sort -u >"$work/allowed"
  { echo "$rooms"; echo solvers/detail; echo "$headers" | tr ' ' '\n' | sed -n 's/.*=//p'; } | sort -u >"$work/all"
  comm -23 "$work/all" "$work/allowed" >"$work/expected"
  cmp -s "$work/refused" "$work/expected" ||
    fail "$room: refused are $(tr '\n' ' ' <"$work/refused"), expected were $(tr '\n' ' ' <"$work/expected")"
  rm "$work/$room/planted.cpp"
done

# refuses MESSAGE: the tree as it is now, with a fault planted; the tree is made anew.
refuses() {
  if check "$table" >"$work.out"; then fail "not refused: $1"; fi
  grep -qF "$1" "$work.out" || fail "no message says: $1; it says: $(cat "$work.out")"
  empty_tree
}
echo '#include "../system/unit.hpp"' >"$work/core/dirac/planted.cpp"
refuses 'core/dirac/planted.cpp: includes "../system/unit.hpp"'
echo '#include <diracstep/core/elsewhere/unit.hpp>' >"$work/core/dirac/planted.cpp"
refuses 'core/elsewhere/unit.hpp, which is in no room'
echo '  #  include <kinsol/kinsol.h>' >"$work/solvers/planted.hpp"
refuses 'solvers/planted.hpp: SUNDIALS is for sources and detail/ only'
mkdir "$work/planted" && touch "$work/planted/unit.cpp"
refuses 'planted: has sources and no line in the table'
mkdir "$work/core/planted" && touch "$work/core/planted/unit.cpp"
refuses 'core/planted: has sources and no line in the table'
touch "$work/core/unit.hpp"
refuses 'core: has sources and no line in the table'
rm "$work/files/unit.hpp"
refuses 'table: files has no sources'
rm "$work/core/dirac/README.md"
refuses 'core/dirac: has no README.md'
seq 11 >"$work/core/dirac/README.md"
refuses 'core/dirac/README.md: has 11 lines, more than 10'
for number in $(seq 25); do touch "$work/core/dirac/planted_$number.hpp" "$work/core/dirac/planted_$number.cpp"; done
refuses 'core/dirac: has 26 units'
mkdir -p "$work/tests/core" && for number in $(seq 26); do touch "$work/tests/core/planted_$number.cpp"; done
refuses 'tests/core: has 26 units'

# The table itself.
sed 's|^core/system: |&core/methods |' "$table" >"$work.table"
check "$work.table" | grep -qF 'core/system names core/methods, which is no library and no room above it' ||
  fail "a room that sees one below it is not refused"
sed 's|^files: .*|&\n&|' "$table" >"$work.table"
check "$work.table" | grep -qF 'table: files has two lines' || fail "a room with two lines is not refused"

exit "$failures"
