# Checks every link of the Markdown pages given: the file or folder must exist, and a heading for its anchor.  Links
# to other hosts are left alone.  Names of pages are relative to the folder it runs in.  The first pass over the pages
# collects their anchors, the second checks: awk -f links.awk pass=1 PAGES pass=2 PAGES
function refuse(why) {
  print FILENAME ":" FNR ": " why > "/dev/stderr"
  failed = 1
}

# The anchor that code hosts give a heading: lower case, punctuation dropped, spaces to hyphens.
function anchor(heading) {
  sub(/^#+ +/, "", heading)
  heading = tolower(heading)
  gsub(/\]\([^)]*\)/, "", heading)
  gsub(/[^a-z0-9_ -]/, "", heading)
  gsub(/ /, "-", heading)
  return heading
}

function folder(path) { return path ~ /\// ? substr(path, 1, match(path, /\/[^\/]*$/)) : "" }

function normal(path) {
  while (sub(/[^\/.][^\/]*\/\.\.\//, "", path) || sub(/(^|\/)\.\//, "/", path)) {}
  return path
}

function exists(path) { return system("test -e '" path "'") == 0 }

function check(target,   file, mark) {
  if (target ~ /^(https?|mailto):/) return
  mark = file = target
  if (sub(/^[^#]*#/, "", mark)) sub(/#.*/, "", file); else mark = ""
  file = file == "" ? FILENAME : normal(folder(FILENAME) file)
  if (!(file in known)) known[file] = exists(file)
  if (!known[file]) refuse("dead link: " target)
  else if (mark != "" && file ~ /\.md$/ && !((file, mark) in anchors)) refuse("no such heading: " target)
  ++checked
}

FNR == 1 { fenced = 0 }
/^ *```/ { fenced = !fenced; next }
fenced { next }
pass == 1 && /^#+ / {
  name = anchor($0)
  anchors[FILENAME, (FILENAME, name) in anchors ? name "-" (++repeated[FILENAME, name]) : name]
}
pass == 1 && match($0, /<a (id|name)="[^"]*"/) {
  name = substr($0, RSTART, RLENGTH)
  gsub(/^[^"]*"|"$/, "", name)
  anchors[FILENAME, name]
}
pass == 2 {
  line = $0
  gsub(/`[^`]*`/, "`", line)
  while (match(line, /\]\([^) ]+[^)]*\)/)) {
    target = substr(line, RSTART + 2, RLENGTH - 3)
    sub(/ .*/, "", target)
    check(target)
    line = substr(line, RSTART + RLENGTH)
  }
}

END {
  print checked + 0 " links checked"
  if (checked == 0) failed = 1
  exit failed
}
