#!/bin/sh
# An hour at the pace of a sensor, ten scans a second, in a town at difficulty 1: an HDL-64E maps for half of it, an
# OS0-128 of another day is then followed in that map. usage: scripts/soak.sh [MINUTES=60, at least 2]
# Fails where a scan was dropped. Build first (`make soak` does).
set -eu
cd "$(dirname "$0")/.."
half=$((${1:-60} / 2))
map=$(mktemp -d)
trap 'rm -rf "$map"' EXIT
build/release/bin/paced_drive slam hdl64e "$half" "$map"
build/release/bin/paced_drive localise os0-128 "$half" "$map" hdl64e
