#!/bin/bash
# A picture of view.launch at the end of a bag, on a display of its own:
#   ./faultline shell scripts/view_picture.sh RIG BAG PICTURE.png [ARGUMENT:=VALUE...]
# Needs Xvfb and ImageMagick (apt install xvfb imagemagick). Draws in software.
set -euo pipefail
[ $# -ge 3 ] || { echo "usage: view_picture.sh RIG BAG PICTURE.png [ARGUMENT:=VALUE...]" >&2; exit 2; }
rig=$1 bag=$(realpath "$2") picture=$3
shift 3
work=$(mktemp -d)
pids=()
finish() {
    for pid in "${pids[@]}"; do kill -INT "$pid" 2>/dev/null || true; wait "$pid" || true; done
    rm -rf "$work"
}
trap finish EXIT
export LIBGL_ALWAYS_SOFTWARE=1 XDG_RUNTIME_DIR=$work ROS_HOME=$work ROS_IP=127.0.0.1
port=$(python3 -c 'import socket; s = socket.socket(); s.bind(("127.0.0.1", 0)); print(s.getsockname()[1])')
export ROS_MASTER_URI=http://127.0.0.1:$port
Xvfb -displayfd 3 -screen 0 1400x850x24 3>"$work/display" 2>/dev/null & pids+=($!)
until [ -s "$work/display" ]; do sleep 0.1; done
DISPLAY=:$(cat "$work/display")
export DISPLAY
: >"$work/said"
roslaunch -p "$port" faultline view.launch rig:="$rig" bag:="$bag" "$@" >"$work/said" 2>&1 & pids+=($!)
for ((i = 0; i < 300; i++)); do
    grep -q "player.*finished cleanly" "$work/said" && break
    kill -0 "${pids[1]}" || { tail -25 "$work/said" >&2; exit 1; }
    sleep 1
done
sleep "${FAULTLINE_SETTLE:-15}"  # rviz may still be starting
import -window root -crop 1370x760+15+62 +repage "$work/whole.png"
convert "$work/whole.png" +dither -colors 96 -strip "$picture"
