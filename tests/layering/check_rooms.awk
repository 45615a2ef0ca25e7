# Reads the table of rooms, then lines "file PATH", "readme LINES PATH" and "include PATH:TEXT"; prints every fault,
# one a line, and fails if there is one.  check_rooms.sh gives it the lines.
BEGIN {
  most_units = 25
  most_readme_lines = 10
  library["Eigen"] = "^Eigen/"
  library["SUNDIALS"] = "^(sundials|sunmatrix|sunlinsol|sunnonlinsol|nvector|kinsol|idas?|cvodes?|arkode)/"
  library["KLU"] = "^(suitesparse/|(klu|amd|btf|colamd)[.]h)"
  library["Spectra"] = "^Spectra/"
  library["Ipopt"] = "^Ip[A-Z]"
  library["Boost"] = "^boost/"
  library["fmt"] = "^fmt/"
  library["toml++"] = "^toml[+][+]/"
  library["CLI11"] = "^CLI/"
  library["nlohmann"] = "^nlohmann/"
  library["MPI"] = "^mpi[.]h"
  library["GoogleTest"] = "^g(test|mock)/"
}

function fault(message) {
  print message
  faults++
}

function folder_of(path) {
  return path ~ /\// ? substr(path, 1, length(path) - length(name_of(path)) - 1) : ""
}

function name_of(path) {
  sub(/.*\//, "", path)
  return path
}

# The room of a folder: itself, or for a folder detail/ the one around it.
function room_of(folder) {
  if (!(folder in rooms)) sub(/\/detail$/, "", folder)
  return folder in rooms ? folder : ""
}

# Whether `seen` is a room of the table or a folder that rooms lie in.
function known(seen, room) {
  if (seen in library || room_of(seen)) return 1
  for (room in rooms) if (index(room, seen "/") == 1) return 1
  return 0
}

function read_table_line(room, words, count, i) {
  room = $1
  if (!sub(/:$/, "", room)) fault("table: a line begins with a room and a colon: " $0)
  if (room in rooms) fault("table: " room " has two lines")
  for (i = 2; i <= NF; i++) {
    if (!known($i)) fault("table: " room " names " $i ", which is no library and no room above it")
    sees[room, $i] = 1
  }
  rooms[room] = 1
}

# Whether the room may include a file of the folder: its line names the folder, or one around it that is no room itself.
function may_see(room, folder) {
  if (room_of(folder) == room || (room, folder) in sees) return 1
  if (folder ~ /\/detail$/) return 0
  while (sub(/\/[^\/]*$/, "", folder))
    if (!(folder in rooms) && (room, folder) in sees) return 1
  return 0
}

function check_project_include(path, room, included, folder) {
  folder = folder_of(included)
  if (folder == "") return  # <diracstep/version.h>
  if (!room_of(folder)) {
    fault(path ": includes " included ", which is in no room of the table")
    return
  }
  if (!may_see(room, folder)) fault(path ": " room " must not include " folder " (" included ")")
}

function check_library_include(path, room, included, name) {
  for (name in library) {
    if (included !~ library[name]) continue
    if (!((room, name) in sees)) fault(path ": " room " must not include " name " (" included ")")
    else if (name ~ /^(SUNDIALS|KLU|Spectra|Ipopt|Boost)$/ && path ~ /[.]hpp$/ && path !~ /\/detail\//)
      fault(path ": " name " is for sources and detail/ only (" included ")")
  }
}

FILENAME != "-" {
  if ($0 !~ /^(#|$)/) read_table_line()
  next
}

$1 == "file" {
  folder = folder_of($2)
  stem = $2
  sub(/[.][^.\/]*$/, "", stem)
  if (!(stem in stems)) units[folder]++
  stems[stem] = 1
  if ($2 !~ /^(tests|bench)\//) {
    if (room_of(folder)) present[room_of(folder)] = 1
    else if (!(folder in reported)) fault(folder ": has sources and no line in the table of rooms")
    reported[folder] = 1
  }
}

$1 == "readme" {
  readme[folder_of($3)] = 1
  if ($2 > most_readme_lines && $3 != "core/README.md")  # the map from equations to files is longer
    fault($3 ": has " $2 " lines, more than " most_readme_lines)
}

$1 == "include" {
  path = $2
  sub(/:.*/, "", path)
  room = room_of(folder_of(path))
  included = $0
  sub(/^[^:]*:[^<"]*/, "", included)
  relative = included ~ /^"/
  sub(/^[<"]/, "", included)
  sub(/[>"].*$/, "", included)
  if (relative) fault(path ": includes \"" included "\"; headers of the project are included as <diracstep/...>")
  else if (!room) next  # reported with its folder
  else if (sub(/^diracstep\//, "", included)) check_project_include(path, room, included)
  else check_library_include(path, room, included)
}

END {
  for (room in rooms) {
    if (!(room in present)) fault("table: " room " has no sources")
    if (!(room in readme)) fault(room ": has no README.md")
  }
  for (folder in units)
    if (units[folder] > most_units)
      fault(folder ": has " units[folder] " units (a source with its header is one), more than " most_units)
  exit faults > 0
}
