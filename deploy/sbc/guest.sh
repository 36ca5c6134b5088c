#!/bin/bash
# Runs on the emulated board, from the console: installs, starts, breaks and checks. Each check is one line
#   CHECK ok|FAIL name (details)
# with tools that know nothing of this project: candump, cansend, ip, systemctl, journalctl.
set -u
cd /
unit=voronoi-touch@index
python=/opt/voronoi-touch/current/bin/python

check() { # name, command...: ok where the command succeeds
    local name=$1
    shift
    if "$@" >/tmp/check.out 2>&1; then echo "CHECK ok $name"; else
        echo "CHECK FAIL $name: $(tail -n 3 /tmp/check.out | tr '\n' ' ')"
    fi
}
show() { echo "SHOW $1"; shift; "$@" 2>&1 | sed 's/^/    /'; }
within() { # seconds, command...: tries until it succeeds
    local end=$((SECONDS + $1))
    shift
    until "$@" >/dev/null 2>&1; do
        [ $SECONDS -lt $end ] || return 1
        sleep 0.5
    done
}
frames() { # interface, how many frames of the finger's TPDO1 within 10 s
    timeout 60 candump -n "$2" "$1,181:7FF" >/tmp/frames 2>&1 && [ "$(wc -l </tmp/frames)" -ge "$2" ]
}
state_is() { [ "$(systemctl is-active $unit)" = "$1" ]; }
pid() { systemctl show -p MainPID --value $unit; }
other_pid() { [ "$(pid)" != "$1" ] && [ "$(pid)" != 0 ] && state_is active; }

echo "BOARD $(uname -srm), $(. /etc/os-release && echo "$PRETTY_NAME"), $(systemctl --version | head -1)"
for module in vcan can-raw kvaser_pci; do modprobe $module; done
ip link add dev vcan0 type vcan
check "can-up.sh brings a virtual bus up" sh /shared/deploy/can-up.sh vcan0

# ---- install ----
start=$SECONDS
check "install.sh" sh /shared/deploy/install.sh --wheels /shared/deploy/sbc/.cache/wheels --finger index --no-start
echo "TIME install $((SECONDS - start)) s"
show "size" du -sm /opt/voronoi-touch
check "own user without a shell" grep -q '^voronoi-touch:.*nologin' /etc/passwd
check "the unit is sound" systemd-analyze verify --recursive-errors=no $unit.service
sed -i 's|can:can0|can:vcan0|' /etc/voronoi-touch/index.toml
mkdir -p /etc/systemd/system/$unit.service.d /var/lib/recording
install -m 644 /shared/tests/data/press.mcap /shared/tests/data/rings331_ball.json /var/lib/recording/
cat >/etc/systemd/system/$unit.service.d/recording.conf <<UNIT
[Service]
ExecStart=
ExecStart=$python -m edge replay /var/lib/recording/press.mcap --loop --config /etc/voronoi-touch/index.toml --calibration /var/lib/recording/rings331_ball.json
TimeoutStartSec=300
WatchdogSec=30
TimeoutStopSec=30
UNIT
systemctl daemon-reload
mount -o remount,ro / 2>/dev/null && echo "SHOW root read-only" && mount -o remount,rw /

# ---- start ----
start=$SECONDS
check "the service starts and says READY" systemctl enable --now $unit
echo "TIME start $((SECONDS - start)) s"
check "it is active" state_is active
show "systemctl status" systemctl status --no-pager -n 5 $unit
check "CAN FD frames flow (candump)" frames vcan0 12
show "candump" timeout 5 candump -n 4 vcan0
check "64 bytes each" grep -q '\[64\]' /tmp/frames
show "ip -s link" ip -s -d link show vcan0
check "it runs as its own user" sh -c "ps -o user= -p $(pid) 2>/dev/null | grep -q voronoi || grep -q 'Uid:.*[1-9]' /proc/$(pid)/status"

# ---- the host library, and an ordinary CANopen request ----
check "the host library reads samples" timeout 60 "$python" - <<'PY'
from hostlink import connect
with connect("can:vcan0") as host:
    samples = host.samples(timeout_s=30)
    got = [next(samples) for _ in range(50)]
assert len(got) == 50 and {s.node for s in got} == {1}, got
PY
(sleep 1; cansend vcan0 601#4018100100000000) &
check "SDO upload of 0x1018:1 answered (cansend)" timeout 20 candump -n 1 vcan0,581:7FF
show "SDO answer" sh -c '(sleep 1; cansend vcan0 601#4018100100000000) & timeout 10 candump -n 1 vcan0,581:7FF'
for garbage in 601#FFFFFFFFFFFFFFFF 601#2300000000 601#R 000#8101FF 601##1DEADBEEF 080#0102; do cansend vcan0 $garbage; done
check "garbage on its identifiers does no harm" frames vcan0 8

# ---- the link goes and comes ----
before=$(pid)
ip link set vcan0 down
sleep 3
check "interface down: the service lives" state_is active
show "processor time while the link is down" sh -c "a=\$(cut -d' ' -f14 /proc/$before/stat); sleep 4; b=\$(cut -d' ' -f14 /proc/$before/stat); echo \$((b - a)) ticks in 4 s"
ip link set vcan0 up
check "interface up: frames flow again" frames vcan0 8
check "in the same process" [ "$(pid)" = "$before" ]

# ---- it dies ----
kill -9 "$before"
check "kill -9: started again" within 120 other_pid "$before"
check "frames flow again" frames vcan0 8
before=$(pid)
kill -STOP "$before"
check "watchdog: a process that hangs is replaced" within 200 other_pid "$before"
check "frames flow again after the watchdog" frames vcan0 8
check "the journal says why" sh -c "journalctl -u $unit --no-pager | grep -qi watchdog"

# ---- the camera goes: the recording ends, is away, and comes back ----
sed -i 's| --loop||' /etc/systemd/system/$unit.service.d/recording.conf
mv /var/lib/recording/press.mcap /var/lib/recording/away
systemctl daemon-reload
systemctl restart --no-block $unit
sleep 20
check "no camera: one clear line in the journal" sh -c "journalctl -u $unit --no-pager | grep -q 'no such file'"
mv /var/lib/recording/away /var/lib/recording/press.mcap
sed -i 's|press.mcap|press.mcap --loop|' /etc/systemd/system/$unit.service.d/recording.conf
systemctl daemon-reload
check "camera back: frames flow by themselves" within 180 frames vcan0 8

# ---- settings survive ----
check "a setting is stored (cansend)" sh -c 'timeout 60 '"$python"' - <<PY
from hostlink import connect
with connect("can:vcan0") as host:
    next(host.samples(timeout_s=30)); host.finger(1).set_rate(7.0)
PY'
systemctl restart $unit
check "and is there after a restart" sh -c "within() { :; }; grep -q '7.0' /var/lib/voronoi-touch/index/settings.json"

# ---- classic CAN with a real driver and bit timing: a pair of emulated controllers ----
pair=$(for d in /sys/class/net/*; do [ "$(basename "$(readlink -f "$d/device/driver" 2>/dev/null)")" = kvaser_pci ] && basename "$d"; done)
set -- $pair
if [ $# -ge 2 ]; then
    check "can-up.sh, classic, first" sh /shared/deploy/can-up.sh "$1" 500000 0
    check "can-up.sh, classic, second" sh /shared/deploy/can-up.sh "$2" 500000 0
    sed -i "s|can:vcan0|can:$1?fd=0|" /etc/voronoi-touch/index.toml
    systemctl restart $unit
    check "classic frames arrive at the other controller" within 120 frames "$2" 8
    show "ip -s -d link of a controller" ip -s -d link show "$1"
    before=$(pid)
    ip link set "$1" down; sleep 2; ip link set "$1" up
    check "controller down and up: frames flow again" within 60 frames "$2" 8
    check "in the same process" [ "$(pid)" = "$before" ]
    # Restart by hand is what a bus-off recovery does; the emulated controllers never see an error of their own.
    check "bit rates that differ are survived" sh -c "ip link set $2 down; ip link set $2 type can bitrate 125000; ip link set $2 up; sleep 3; systemctl is-active -q $unit; ip link set $2 down; ip link set $2 type can bitrate 500000; ip link set $2 up"
    check "and frames flow again" within 60 frames "$2" 8
    check "doctor judges the controller" sh -c "$python -m edge doctor --source /var/lib/recording/press.mcap --sink 'can:$1?fd=0' --json | tee /tmp/doctor | grep -q '0.5 Mbit/s'"
    show "doctor" cat /tmp/doctor
else
    echo "CHECK FAIL no pair of emulated controllers: $pair"
fi

# ---- end, away (upgrade and roll back: tests/deploy) ----
start=$SECONDS
check "stop" systemctl stop $unit
echo "TIME stop $((SECONDS - start)) s"
check "ended cleanly" sh -c "[ \$(systemctl show -p Result --value $unit) = success ]"
sum=$(md5sum /etc/voronoi-touch/index.toml /var/lib/voronoi-touch/index/* | md5sum)
check "uninstall" sh /shared/deploy/install.sh --uninstall
check "configuration and settings are as before" [ "$(md5sum /etc/voronoi-touch/index.toml /var/lib/voronoi-touch/index/* | md5sum)" = "$sum" ]
check "settings are kept" [ -e /var/lib/voronoi-touch/index/settings.json ]
check "the software is gone" [ ! -e /opt/voronoi-touch ]
show "journal" journalctl -u $unit --no-pager -n 40 -o cat
echo "DONE"
