#!/bin/sh
# sick_planner.sh FOLDER PROGRAM DOMAIN PROBLEM: a planner that dies as long as there is no FOLDER/healthy. How often it was
# asked is in FOLDER/asked.
echo asked >> "$1/asked"
test -e "$1/healthy" || kill -9 $$
"$2" plan "$3" "$4"
