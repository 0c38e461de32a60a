#!/bin/bash
# Photographs the top of a report with a headless chromium (apt-get install chromium; ImageMagick makes it smaller): of
# the diagnosis of BAG, or one that was written before.
#   scripts/report_picture.sh BAG|REPORT.html OUT.png
# Called through the door, so that program and session are there: ./faultline shell scripts/report_picture.sh BAG OUT.png
set -euo pipefail

fail() { printf 'report_picture: %s\n' "$*" >&2; exit 2; }
(($# == 2)) || fail "usage: scripts/report_picture.sh BAG|REPORT.html OUT.png"
browser=$(command -v chromium || command -v chromium-browser || command -v google-chrome) ||
  fail "no chromium here; install it with: apt-get install chromium"
here=$(cd -- "$(dirname -- "$(readlink -f -- "${BASH_SOURCE[0]}")")" && pwd)
folder=$(mktemp -d "${TMPDIR:-/tmp}/faultline_picture.XXXXXX")
trap 'rm -rf "$folder"' EXIT

case $1 in
  *.html) cp -- "$1" "$folder/report.html" ;;
  *) "$here/report.py" diagnose "$1" -o "$folder/report.html" ;;
esac
root_only=()
if ((EUID == 0)); then root_only=(--no-sandbox); fi
timeout 60 "$browser" --headless=new "${root_only[@]}" --disable-gpu --hide-scrollbars --user-data-dir="$folder/profile" \
  --window-size=1180,1510 --screenshot="$folder/page.png" "file://$folder/report.html" > "$folder/log" 2>&1 ||
  fail "chromium failed: $(tail -n 1 "$folder/log")"
[[ -s $folder/page.png ]] || fail "chromium wrote no picture: $(tail -n 1 "$folder/log")"
convert "$folder/page.png" +dither -colors 96 -strip "$2"
printf 'report_picture: written to %s\n' "$2"
