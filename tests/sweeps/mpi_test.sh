#!/bin/sh
# mpi_test.sh COMMAND COMMAND_WITH_MPI MPIRUN WORK: ranks share a sweep, or the parts of
# one scene, and the results are those of one process.
set -eu
command="$1" with_mpi="$2" mpirun="$3" work="$4"
rm -rf "$work" && mkdir -p "$work" && cd "$work"
cat >orbits.toml <<'END'
scene = "kepler_e06"
method = "type1/gl:2"
step = 0.01
end = 20
block = 2
[grid]
e = { from = 0.1, to = 0.5, count = 20 }
END
"$command" sweep orbits.toml --out one --json >one.json
export OMPI_ALLOW_RUN_AS_ROOT=1 OMPI_ALLOW_RUN_AS_ROOT_CONFIRM=1 OMPI_MCA_rmaps_base_oversubscribe=1
for ranks in 2 4; do
  "$mpirun" -n "$ranks" "$with_mpi" sweep orbits.toml --out "ranks$ranks" --threads 1 --json >"ranks$ranks.json"
  for file in results.csv results.npy report.html; do cmp "one/$file" "ranks$ranks/$file"; done
  [ "$(grep -c '"complete": true' "ranks$ranks.json")" = 1 ]
done
# A rank that cannot write ends all of them.
if "$mpirun" -n 2 "$with_mpi" sweep orbits.toml --out no/such/folder 2>messages; then exit 1; fi
grep -q "no/such/folder" messages
"$with_mpi" sweep orbits.toml --out alone --json >alone.json  # without mpirun
cmp one/results.csv alone/results.csv

# Parts of one scene: the same bits, and the messages of the cut, 2 + 40 steps of 5 stages.
"$command" parts toda_200 --set N=1000 --step 0.05 --end 2 --order 4 --out one.npy >one.txt
for ranks in 2 4; do
  "$mpirun" -n "$ranks" "$with_mpi" parts toda_200 --set N=1000 --step 0.05 --end 2 --order 4 --out ranks.npy --json >ranks.json
  cmp one.npy ranks.npy
  messages=$(sed -n '/"messages"/,/]/p' ranks.json | grep -c "$(( (ranks == 2 ? 1 : 2) * (2 + 40 * 5) ))")
  [ "$messages" = "$ranks" ]
done
# Steps that are too large end with what is doubted, in one process and in two.
for run in "$command" "$mpirun -n 2 $with_mpi"; do
  status=0
  $run parts toda_200 --step 4 --end 400 2>messages >/dev/null || status=$?
  [ "$status" = 3 ]
  grep -q "take smaller steps\|too large" messages
done
if "$mpirun" -n 2 "$with_mpi" parts toda_200 --out no/such/folder/end.npy 2>messages; then exit 1; fi
grep -q "no/such/folder" messages
