#!/bin/sh
# run_page.sh PAGE PREFIX WORK [slow]: does what the code blocks of PAGE say, in their order, in the empty folder
# WORK.  The page's ~/diracstep is PREFIX, where DiracStep is installed, and its command is on the path.
#   cpp, c compile without warnings; a program is linked and run
#   sh     runs; a command that fails ends the test
#   toml   passes `diracstep check` as the scene it names
#   python runs after the other blocks, all of the page as one program
# Any other block must be a file that a later block uses, or say why it is not run (blocks.awk has the marks).
set -eu
page="$1" prefix="$2" work="$3" slow="${4:-}"
tests="$(cd "$(dirname "$0")" && pwd)"
sources="$(cd "$tests/../.." && pwd)"

rm -rf "$work"
mkdir -p "$work/blocks" "$work/home"
ln -s "$prefix" "$work/home/diracstep"
ln -s "$sources/examples" "$sources/scenes" "$work"
cd "$work"
awk -v OUT=blocks -f "$tests/blocks.awk" "$page" >blocks/list
HOME="$work/home" PATH="$prefix/bin:$PATH" DIRACSTEP_CACHE="$work/cache"
export HOME PATH DIRACSTEP_CACHE

refuse() { echo "$page: block $number ($language): $1" >&2; exit 1; }

build_programs() {
  programs="$(awk '($2 == "c" || $2 == "cpp") && $3 == "run" { printf "%s%02d.%s", n++ ? ";" : "", $1, $2 }' blocks/list)"
  [ -n "$programs" ] || return 0
  cmake -S "$tests/programs" -B programs -D CMAKE_PREFIX_PATH="$prefix" -D SOURCES="$programs" \
        -D BLOCKS="$work/blocks" >programs.log || { cat programs.log; exit 1; }
  cmake --build programs --parallel 2
}

run_python() {  # with the package of the sources and the library of PREFIX
  set -- $(awk '$2 == "python" && $3 == "run" { printf "blocks/%02d.python\n", $1 }' blocks/list)
  [ $# -gt 0 ] || return 0
  case "${CXXFLAGS:-}" in
    *-fsanitize*) echo "not checked: blocks in Python: an interpreter cannot load a library with sanitizers"; return 0 ;;
  esac
  python="$(PATH="/usr/bin:$PATH" command -v python3 || true)"
  for module in numpy matplotlib; do
    "${python:-false}" -c "import $module" 2>/dev/null || { echo "not checked: blocks in Python: python3-$module is missing"; return 0; }
  done
  for block in "$@"; do printf '# %s\n' "$block"; cat "$block"; done >page.py
  DIRACSTEP_LIBRARY="$(find "$prefix" -name libdiracstep.so | head -n 1)" PYTHONPATH="$sources/python" PYTHONDONTWRITEBYTECODE=1 \
    MPLBACKEND=Agg MPLCONFIGDIR="$work" "$python" -W error page.py || { echo "$page: a block in Python fails" >&2; exit 1; }
}

examine_scene() {  # FILE; interpreted, which gives the same bits as compiled
  scene="$(sed -n 's/^name = "\(.*\)"$/\1/p' "$1" | head -n 1)"
  [ -n "$scene" ] || refuse "a scene without a name"
  cp "$1" "$scene.toml"
  DIRACSTEP_CC=none diracstep check "$scene.toml" || refuse "$scene.toml does not pass"
}

save_file() {
  mkdir -p "$(dirname "$argument")"
  cp "$1" "$argument"
  awk -v this="$number" '$1 > this' blocks/list | while read -r later rest; do cat "blocks/$(printf %02d "$later")".*; done |
    grep -qF "${argument%%/*}" || refuse "no later block names the file $argument"
}

build_programs
while read -r number language mark argument <&3; do
  block="blocks/$(printf %02d "$number").$language"
  case "$mark" in
    not-run) continue ;;
    slow) [ -n "$slow" ] || continue ;;
    file) save_file "$block"; continue ;;
    added) cat "$argument.toml" "$block" >"$block.whole"; block="$block.whole" ;;
  esac
  echo "== block $number ($language)"
  case "$language" in
    sh) sh -ex "$block" || refuse "fails" ;;
    c | cpp)
      program="programs/$(printf %02d "$number")"
      [ ! -x "$program" ] || "$program" || refuse "the program fails" ;;
    toml) examine_scene "$block" ;;
    python) ;;
    *) refuse "no test runs this; mark it '<!-- file: NAME -->' or '<!-- not run: WHY -->'" ;;
  esac
done 3<blocks/list
run_python
