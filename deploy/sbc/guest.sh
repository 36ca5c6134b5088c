#!/bin/bash
# Runs on the emulated board, from the console: installs, starts, breaks and checks. Each check is one line
#   CHECK ok|FAIL name (seconds)
# with tools that know nothing of this project: candump, cansend, ip, systemctl, journalctl. What is waited for is
# an event wherever there is one: a frame, a line of the journal.
set -u
cd /
unit=voronoi-touch@index
dropin=/etc/systemd/system/$unit.service.d/board.conf
python=/opt/voronoi-touch/current/bin/python
recording=/var/lib/recording

check() { # name, command...: ok where the command succeeds
    local name=$1 begun=$SECONDS
    shift
    if "$@" >/run/check.out 2>&1; then echo "CHECK ok $name ($((SECONDS - begun)) s)"; else
        echo "CHECK FAIL $name ($((SECONDS - begun)) s): $(tail -n 3 /run/check.out | tr '\n' ' ')"
        show "the journal at that moment" journalctl -u $unit --no-pager -n 12 -o short-monotonic
        return 1
    fi
}
show() { echo "SHOW $1"; shift; "$@" 2>&1 | sed 's/^/    /'; }
# TPDO1 of node 1 on an interface: as many frames as are asked for. Patience is for the emulated processor: a
# search for all pins takes it 5 s and more.
frames() { timeout 200 candump -n "$2" "$1,181:7FF" >/run/frames 2>&1 && [ "$(wc -l </run/frames)" -ge "$2" ]; }
# Listening begins before what is to be heard is caused: `listen FILTER`, then the deed, then `heard PATTERN`.
listen() { exec 5< <(exec timeout 240 candump "$@"); sleep 0.3; }
heard() { grep -m 1 -E "$1" <&5; }
now() { date +%s; }
journal() { # since, pattern: waits until the journal says it
    grep -m 1 -E "$2" < <(exec timeout 120 journalctl -f --since "@$1" -o cat -u $unit)
}
is_active() { [ "$(systemctl is-active $unit)" = active ]; }
pid() { systemctl show -p MainPID --value $unit; }
program() { # what the unit runs
    mkdir -p "$(dirname "$dropin")"
    # An emulated processor takes 20 s for what a board does in one: to start, and for the first rest frame.
    printf '[Service]\nExecStart=\nExecStart=%s -m edge %s\nTimeoutStartSec=300\nWatchdogSec=60\nTimeoutStopSec=60\n' \
        "$python" "$*" >"$dropin"
    systemctl daemon-reload
}
# Three images a second: what an emulated processor computes without falling behind.
replay="replay $recording/press.mcap --loop --speed 0.05 --config /etc/voronoi-touch/index.toml --calibration $recording/rings331_ball.json"
sink() { sed -i "s|^sinks = .*|sinks = [\"$1\"]|" /etc/voronoi-touch/index.toml; }

# shellcheck disable=SC1091
echo "BOARD $(uname -srm), $(. /etc/os-release && echo "$PRETTY_NAME"), $(systemctl --version | head -1)"
for module in vcan can-raw kvaser_pci slcan; do modprobe $module; done
modprobe vivid n_devs=1 node_types=0x1
ip link add dev vcan0 type vcan
check "can-up.sh brings a virtual bus up" sh /shared/deploy/can-up.sh vcan0

# ---- install ----
check "install.sh, from wheels, without network" sh /shared/deploy/install.sh \
    --wheels /shared/deploy/sbc/.cache/wheels --finger index --no-start
show "installed size, MB" du -sm /opt/voronoi-touch
check "own user without a shell" grep -q '^voronoi-touch:.*nologin' /etc/passwd
check "the unit is sound" systemd-analyze verify --recursive-errors=no $unit.service
install -D -m 644 -t $recording /shared/tests/data/press.mcap /shared/tests/data/rings331_ball.json
sink can:vcan0
# shellcheck disable=SC2086
program $replay

# ---- start ----
check "the service starts and says READY" systemctl enable --now $unit
check "it is active" is_active
check "CAN FD frames flow (candump)" frames vcan0 12
show "candump" head -n 4 /run/frames
check "64 bytes each" sh -c "[ \$(grep -c '\[64\]' /run/frames) = 12 ]"
show "systemctl status" systemctl status --no-pager -n 5 $unit
show "ip -s link" ip -s -d link show vcan0
check "it runs as its own user" sh -c "grep -q \"^Uid:.\$(id -u voronoi-touch)\" /proc/$(pid)/status"

"$python" - <<'PY'
import logging, time, can, threading
logging.basicConfig(level=logging.DEBUG)
logging.getLogger("can").setLevel(logging.WARNING)
bus = can.Bus(interface="socketcan", channel="vcan0", fd=True)
t = time.time()
for k in range(6):
    m = bus.recv(3)
    print("RAW", k, round(time.time() - t, 2), m, m and (m.timestamp, time.time(), m.is_error_frame, m.is_remote_frame, m.is_fd, type(m.data)), flush=True)
bus.shutdown()
from hostlink import connect, links
old = links.CanLink._read
def read(self, medium):
    d = old(self, medium)
    if d is not None: print("READ", d.arbitration_id, len(d.data), d.timestamp, time.time(), self._arrival.time_s(d), time.monotonic(), flush=True)
    return d
links.CanLink._read = read
with connect("can:vcan0") as host:
    samples = host.samples(timeout_s=8)
    try:
        for k in range(4):
            s = next(samples); print("SAMPLE", s.state.sample, s.age_s, flush=True)
    except Exception as e:
        print("ERR", repr(e), flush=True)
    print("STAT", host.statistics, host._link.guard.unforeseen_n, host._link._thread.is_alive(), threading.enumerate(), flush=True)
PY
echo "DONE"
exit 0
