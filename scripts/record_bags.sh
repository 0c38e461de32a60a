#!/bin/bash
# Records the shipped sessions again, as bags/index.yaml says. Usage: ./faultline shell scripts/record_bags.sh
set -euo pipefail
root=$(cd -- "$(dirname -- "${BASH_SOURCE[0]}")/.." && pwd)
program=${FAULTLINE_PROGRAM:-$root/catkin_ws/devel/lib/faultline/faultline}
/usr/bin/python3 - "$root/bags/index.yaml" <<'PY' | while IFS=$'\t' read -r file command; do
import sys, yaml
for session in yaml.safe_load(open(sys.argv[1]))["bags"]:
    print(session["file"], session["command"], sep="\t")
PY
  # shellcheck disable=SC2086
  "$program" $command -o "$root/bags/$file"
done
