#!/bin/sh
# What `acopla run` does, by hand: one coupler, and each solver told where it is and who it is. Built programs are taken
# from build/release; the results go to cases/box_fill/results.
cd "$(dirname "$0")" && bin=${ACOPLA_BIN:-../../build/release/bin} && hub=ipc:///tmp/box_fill-$$
"$bin/acopla-coupler" case.toml --bind "$hub" --results results &
"$bin/acopla-dem" case.toml --connect "$hub" --as grains &
"$bin/acopla-fem" case.toml --connect "$hub" --as structure &
wait %1; code=$?; wait; exit $code
