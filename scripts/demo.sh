#!/bin/bash
# The demo: a recorded session replayed through the whole node graph on a ROS master of its own, alarms as they appear, the
# verdict, an HTML report. Called by `./faultline demo` in the built environment. Leaves nothing running, however it ends.
set -euo pipefail

here=$(cd -- "$(dirname -- "$(readlink -f -- "${BASH_SOURCE[0]}")")" && pwd)
rig=servo_actuator
bag=$here/../bags/servo_actuator_step_leak.bag
output=faultline_report.html
rate=5
patience=60   # s without any sign of life from the graph

usage() {
  cat <<TEXT
usage: ./faultline demo [--output FILE.html] [--bag BAG] [--rig RIG] [--rate FACTOR]

Replays a recorded session through the node graph, prints alarms as they appear and the verdict, and writes a report.
  --output, -o   the report (default: faultline_report.html in this folder)
  --bag          the session (default: bags/servo_actuator_step_leak.bag)
  --rig          the rig it was recorded on (default: $rig)
  --rate         how many times faster than recorded (default: $rate)
TEXT
}

say() { printf 'faultline: %s\n' "$*"; }
fail() { printf 'faultline demo: %s\n' "$*" >&2; exit 2; }

while (($#)); do
  case $1 in
    -h | --help) usage; exit 0 ;;
    -o | --output | --bag | --rig | --rate)
      (($# > 1)) || fail "$1 needs a value; see ./faultline demo --help"
      case $1 in
        --bag) bag=$2 ;;
        --rig) rig=$2 ;;
        --rate) rate=$2 ;;
        *) output=$2 ;;
      esac
      shift 2
      ;;
    *) fail "unknown option $1; see ./faultline demo --help" ;;
  esac
done
[[ -f $bag ]] || fail "$bag: no such file; give a recorded session with --bag"
bag=$(readlink -f -- "$bag")
[[ $rate =~ ^[0-9]*\.?[0-9]+$ && $rate =~ [1-9] ]] || fail "--rate $rate: not a positive number"

# ---- Whatever happens, what was started ends. By process id, never by name.

folder=$(mktemp -d "${TMPDIR:-/tmp}/faultline_demo.XXXXXX")
master='' launch='' watch=''

family() {  # a process and all that came from it
  local child
  for child in $(ps -o pid= --ppid "$1" 2> /dev/null); do family "$child"; done
  echo "$1"
}

alive() { kill -0 "$1" 2> /dev/null; }

# end PID: interrupt it, so that it can end its own children; then, with less and less patience, all of its family.
end() {
  local pid=$1 members signal tries member left
  [[ -n $pid ]] && alive "$pid" || return 0
  members=$(family "$pid")
  for ((tries = 0; tries < 40; ++tries)); do
    alive "$pid" || break
    # Again every second: a process that is just starting may not have heard.
    if ((tries % 10 == 0)); then kill -INT "$pid" 2> /dev/null || true; fi
    sleep 0.1
  done
  for signal in TERM KILL; do
    for ((tries = 0; tries < 20; ++tries)); do
      left=''
      for member in $members; do
        if alive "$member"; then
          left=yes
          if ((tries == 0)); then kill -"$signal" "$member" 2> /dev/null || true; fi
        fi
      done
      [[ -n $left ]] || break 2
      sleep 0.1
    done
  done
  wait "$pid" 2> /dev/null || true
}

leave() {
  local code=$?
  trap '' INT TERM HUP
  trap - EXIT
  end "$watch"
  end "$launch"
  end "$master"
  if ((code == 1)); then tail -n 15 "$folder/launch.log" >&2 2> /dev/null || true; fi
  rm -rf "$folder"
  exit "$code"
}
trap leave EXIT
trap 'exit 130' INT
trap 'exit 143' TERM HUP

# ---- A master of its own, on a port that is free, on this machine alone

port=$(python3 -c 'import socket; s = socket.socket(); s.bind(("127.0.0.1", 0)); print(s.getsockname()[1])')
export ROS_MASTER_URI=http://127.0.0.1:$port ROS_IP=127.0.0.1 ROS_HOME=$folder/ros ROS_LOG_DIR=$folder/ros/log
export PYTHONDONTWRITEBYTECODE=1 PYTHONUNBUFFERED=1
unset ROS_HOSTNAME ROS_NAMESPACE
mkdir -p "$ROS_LOG_DIR"

# wait_for WHAT PID COMMAND...: until the command succeeds; the process PID must live meanwhile
wait_for() {
  local what=$1 pid=$2 began=$SECONDS
  shift 2
  until "$@" > /dev/null 2>&1; do
    alive "$pid" || { say "$what ended before it was ready" >&2; exit 1; }
    ((SECONDS - began < patience)) || { say "$what is not ready after $patience s" >&2; exit 1; }
    sleep 0.05
  done
}
listens() { (exec 3<> "/dev/tcp/127.0.0.1/$port") 2> /dev/null; }

set -m  # each in a process group of its own, so that Ctrl-C at the terminal reaches this script first
say "replaying $(basename -- "$bag") at $rate times its speed through the node graph (ROS master on port $port)"
roscore -p "$port" < /dev/null > "$folder/master.log" 2>&1 &
master=$!
set +m
wait_for "the ROS master" "$master" listens

set -m
python3 "$here/watch_alarms.py" --rig "$rig" --bag "$bag" --until-replay-ends --timeout "$patience" --ready "$folder/ready" < /dev/null &
watch=$!
set +m
wait_for "the alarm listener" "$watch" test -e "$folder/ready"

set -m
roslaunch --wait faultline replay.launch rig:="$rig" bag:="$bag" rate:="$rate" < /dev/null > "$folder/launch.log" 2>&1 &
launch=$!
set +m

# The listener ends when the replay does, or when nothing comes any more. Where the launch is over, by itself or because it
# failed, the listener gets a few seconds to hear the rest.
rest=30
while alive "$watch"; do
  if ! alive "$launch"; then
    wait "$launch" || { say "roslaunch failed" >&2; exit 1; }
    ((rest-- > 0)) || kill -INT "$watch" 2> /dev/null || true
  fi
  sleep 0.1
done
wait "$watch" || exit 1
watch=''
end "$launch"
launch=''
end "$master"
master=''

python3 "$here/report.py" diagnose "$bag" -o "$output"
say "open $output in a browser; ./faultline help tells what else there is"
