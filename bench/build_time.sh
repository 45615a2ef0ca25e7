#!/usr/bin/env bash
# build_time.sh [TARGET]: where the time of a build goes.  Configures build/timed afresh as the preset release, builds
# TARGET (diracstep without one) without any cache of compiled objects, and prints the CPU seconds of the compiler by
# folder and for the slowest sources.  CPU time, so other work on the machine hardly changes it.
set -euo pipefail
root="$(cd "$(dirname "${BASH_SOURCE[0]}")/.." && pwd)"
log="$root/build/timed/compiler_seconds"

if [ "${1:-}" = --compile ]; then # COMMAND...: the compiler's launcher
  shift
  TIMEFORMAT='%U %S' status=0
  exec 3>&1 4>&2
  seconds="$({ time "$@" >&3 2>&4; } 2>&1)" || status=$?
  while [ $# -gt 1 ] && [ "$1" != -o ]; do shift; done
  echo "$seconds ${2:-?}" >>"$log" # one line: written at once
  exit "$status"
fi

rm -rf "$root/build/timed"
mkdir -p "$root/build/timed"
: >"$log"
export CCACHE_DISABLE=1
cmake -S "$root" -B "$root/build/timed" -G Ninja -DCMAKE_BUILD_TYPE=Release \
  -DCMAKE_CXX_COMPILER_LAUNCHER="$root/bench/build_time.sh;--compile" >"$root/build/timed/output" || {
  cat "$root/build/timed/output"
  exit 1
}
TIMEFORMAT='the whole build of this target, linking included: %U s of user and %S s of system time'
time cmake --build "$root/build/timed" --target "${1:-diracstep}" --parallel "$(nproc)" >>"$root/build/timed/output"

awk '
  { seconds = $1 + $2; name = $3; sub(/CMakeFiles\/[^\/]*\.dir\//, "", name); sub(/\.o$/, "", name)
    folder = name; if (name ~ /\.gch$/) folder = "precompiled headers"; else if (!sub(/\/[^\/]*$/, "", folder)) folder = "."
    all += seconds; of[folder] += seconds; count[folder]++; each[name] = seconds }
  END {
    printf "\n%8s %8s  %s\n", "CPU s", "sources", "folder"
    for (f in of) printf "%8.1f %8d  %s\n", of[f], count[f], f | "sort -k1,1nr"
    close("sort -k1,1nr")
    printf "%8.1f %8d  all\n\n%8s  %s\n", all, NR, "CPU s", "the slowest sources"
    for (n in each) printf "%8.1f  %s\n", each[n], n | "sort -k1,1nr | head -n 25"
  }' "$log"
