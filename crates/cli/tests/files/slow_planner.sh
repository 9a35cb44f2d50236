#!/bin/sh
# slow_planner.sh FOLDER PROGRAM DOMAIN PROBLEM: a planner that takes its time, for the tests that kill. Its process
# number is in FOLDER/planner.
echo $$ > "$1/planner"
sleep 0.3
"$2" plan "$3" "$4"
