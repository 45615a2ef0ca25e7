# The table of the paper's items in core/README.md is whole and true: every numbered equation, definition, proposition and
# theorem is in a row, and every test that a row names by a letter stands in the file of that letter:
# awk -f paper_table.awk -v tests=FOLDER core/README.md
function refuse(why) {
  print why > "/dev/stderr"
  failed = 1
}

# "(4.25)–(4.28)" covers four equations, "Propositions 10.2, 10.3" two items.
function cover(cell,   range, ends, i, number) {
  while (match(cell, /\([0-9]+\.[0-9]+\)(–\([0-9]+\.[0-9]+\))?/)) {
    range = substr(cell, RSTART, RLENGTH)
    cell = substr(cell, RSTART + RLENGTH)
    gsub(/[()]/, "", range)
    split(range "–" range, ends, "–")
    split(ends[1], first, ".")
    split(ends[2], last, ".")
    for (i = first[2]; i <= last[2]; ++i) covered[first[1] "." i] = 1
  }
}

function cover_items(cell,   kind, numbers, parts, i) {
  while (match(cell, /(Definition|Proposition|Theorem)s? [0-9]+\.[0-9]+(, [0-9]+\.[0-9]+)*/)) {
    numbers = substr(cell, RSTART, RLENGTH)
    cell = substr(cell, RSTART + RLENGTH)
    kind = substr(numbers, 1, index(numbers, " ") - 1)
    sub(/s$/, "", kind)
    sub(/^[^ ]* /, "", numbers)
    split(numbers, parts, ", ")
    for (i in parts) items[kind " " parts[i]] = 1
  }
}

function holds(file, name) { return system("grep -qE 'TEST(_[FP])?\\((\\w+, )?" name "' " tests "/" file) == 0 }

function check_tests(cell,   parts, i, letter, name) {
  split(cell, parts, ";")
  for (i = 1; i in parts; ++i) {
    if (!match(parts[i], /^ *[A-Z][ ,]/)) continue
    letter = substr(parts[i], RSTART + RLENGTH - 2, 1)
    if (!(letter in files)) continue
    while (match(parts[i], /`[A-Z][A-Za-z]+(…)?`/)) {
      name = substr(parts[i], RSTART + 1, RLENGTH - 2)
      parts[i] = substr(parts[i], RSTART + RLENGTH)
      sub(/…$/, "", name)
      ++named
      if (!holds(files[letter], name)) refuse(FILENAME ":" FNR ": no test " name " in " files[letter])
    }
  }
}

/^## / { inside = /The paper, item by item/ }
# "`dirac_laws_test.cpp` (L)"
inside && !/^\|/ {
  line = $0
  while (match(line, /[a-z_]+_test\.cpp` \([A-Z]\)/)) {
    word = substr(line, RSTART, RLENGTH)
    line = substr(line, RSTART + RLENGTH)
    files[substr(word, length(word) - 1, 1)] = substr(word, 1, index(word, ".cpp") + 3)
  }
}
inside && /^\|/ {
  split($0, cells, "|")
  cover(cells[2])
  cover_items(cells[2])
  check_tests(cells[4])
}

END {
  split("0 27 15 53 9 19 29 26 20 14", most, " ")
  for (section = 2; section <= 10; ++section)
    for (i = 1; i <= most[section]; ++i)
      if (!((section "." i) in covered)) refuse("no row holds (" section "." i ")")
  wanted = "Proposition 2.1,Definition 3.1,Definition 3.2,Proposition 8.1,Proposition 8.2,Proposition 8.3,Theorem 8.4,"
  wanted = wanted "Proposition 10.1,Proposition 10.2,Proposition 10.3,Theorem 10.4"
  split(wanted, list, ",")
  for (i in list)
    if (!(list[i] in items)) refuse("no row holds " list[i])
  if (named < 20) refuse("only " named + 0 " tests are named")
  exit failed
}
