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

# ---- the host library, and ordinary CANopen requests ----
check "the host library reads samples" timeout 120 "$python" - <<'PY'
from hostlink import connect
with connect("can:vcan0") as host:
    samples = host.samples(timeout_s=30)
    got = [next(samples) for _ in range(20)]
    next(s for s in samples if s.state.displacement_mm >= 0)  # NaN, until it has its rest frame, is not
assert len({s.state.sample for s in got}) == 20, got
PY
listen vcan0,581:7FF
cansend vcan0 601#4018100100000000
check "SDO upload of 0x1018:1 is answered (cansend, candump)" heard '581 +\[8\] +43 18 10 01'
show "the answer" tail -n 1 /run/check.out
for garbage in 601#FFFFFFFFFFFFFFFF 601#2300000000 601#R 000#8101FF 601##1DEADBEEF 080#0102; do cansend vcan0 $garbage; done
check "garbage on its identifiers does no harm" frames vcan0 8
# 0x2020:1 is the rate, REAL32: 7.0 is 00 00 E0 40.
listen vcan0,581:7FF
cansend vcan0 601#232020010000E040
check "a setting is written (cansend)" heard '581 +\[8\] +60 20 20 01'
check "and stored" grep -q '"rate_hz": 7' /var/lib/voronoi-touch/index/settings.json

# ---- the link goes and comes ----
before=$(pid)
ip link set vcan0 down
sleep 3
check "interface down: the service lives" is_active
ticks=$(cut -d' ' -f14,15 "/proc/$before/stat" | tr ' ' +)
sleep 4
echo "SHOW processor time while the link is down"
echo "    $(($(cut -d' ' -f14,15 "/proc/$before/stat" | tr ' ' +) - ticks)) ticks of 10 ms in 4 s"
ip link set vcan0 up
check "interface up: frames flow again" frames vcan0 8
check "in the same process" [ "$(pid)" = "$before" ]

# ---- it dies, it hangs ----
listen vcan0,701:7FF
kill -9 "$before"
check "kill -9: started again, boot-up on the bus" heard '701 +\[1\] +00'
check "frames flow again" frames vcan0 8
check "another process" [ "$(pid)" != "$before" ]
listen vcan0,601:7FF,581:7FF
cansend vcan0 601#4020200100000000
check "the setting is still there after kill -9" heard '581 +\[8\] +43 20 20 01 00 00 E0 40'
before=$(pid)
begun=$(now)
listen vcan0,701:7FF
kill -STOP "$before"
check "watchdog: a process that hangs is replaced" heard '701 +\[1\] +00'
check "frames flow again" frames vcan0 8
check "the journal says why" journal "$begun" '[Ww]atchdog'
show "the journal" sh -c "journalctl -u $unit --no-pager --since @$begun -o cat | head -n 6"

# ---- classic CAN with a real driver and bit timing: a pair of emulated controllers ----
pair=$(for d in /sys/class/net/*; do [ "$(basename "$(readlink -f "$d/device/driver" 2>/dev/null)")" = kvaser_pci ] && basename "$d"; done)
# shellcheck disable=SC2086
set -- $pair
if [ $# -ge 2 ]; then
    check "can-up.sh, classic, first controller" sh /shared/deploy/can-up.sh "$1" 500000 0
    check "can-up.sh, classic, second controller" sh /shared/deploy/can-up.sh "$2" 500000 0
    sink "can:$1?fd=0"
    systemctl restart $unit
    check "classic frames arrive at the other controller" frames "$2" 16
    show "candump at the other controller" head -n 8 /run/frames
    check "8 bytes at most" sh -c "! grep -v '\[[0-8]\]' /run/frames"
    show "ip -s -d link of a controller" ip -s -d link show "$1"
    before=$(pid)
    ip link set "$1" down
    sleep 2
    ip link set "$1" up
    check "controller down and up: frames flow again" frames "$2" 8
    # The emulated bus carries frames at any bit rate: this is a controller that is set anew while the finger runs.
    ip link set "$1" down
    ip link set "$1" type can bitrate 125000
    ip link set "$1" up
    check "controller at another bit rate: frames flow again" frames "$2" 8
    check "in the same process" [ "$(pid)" = "$before" ]
    check "doctor judges the controller" sh -c \
        "$python -m edge doctor --source $recording/press.mcap --sink 'can:$1?fd=0' --json | tee /run/doctor | grep -q '0.125 Mbit/s'"
    show "doctor" cat /run/doctor
else
    echo "CHECK FAIL no pair of emulated controllers: $pair"
fi

# ---- bus-off: a serial adapter that can say so; see serial_adapter.py ----
coproc adapter { exec python3 /shared/deploy/sbc/serial_adapter.py; }
read -r -t 30 _ serial <&"${adapter[0]}"
tell() { # command, awaited answer
    echo "$1" >&"${adapter[1]}"
    read -r -t 200 answer <&"${adapter[0]}" && [[ $answer == $2* ]]
}
state() { ip -d link show "$serial" | grep -q "state $1"; }
ip link set "$serial" up
sink "can:$serial?fd=0"
systemctl restart $unit
check "frames reach the serial adapter" tell "frames 181 8" came
before=$(pid)
begun=$(now)
check "the controller goes bus-off" tell off told
check "the kernel says so (ip -d link)" state BUS-OFF
show "ip -s -d link in bus-off" ip -s -d link show "$serial"
check "and the service" journal "$begun" 'BUS_OFF: '
check "it lives" is_active
ip link set "$serial" down # this driver has no restart of its own: as a person, or systemd-networkd, would
ip link set "$serial" up
check "recovered: error-active" state ERROR-ACTIVE
check "frames reach the adapter again" tell "frames 181 8" came || {
    show "ip -s -d link then" ip -s -d link show "$serial"
    show "its queue" tc -s qdisc show dev "$serial"
    show "what the service said of the link" sh -c "journalctl -u $unit --since @$begun --no-pager -o short-monotonic | grep -v TRACKER"
}
check "the service says so" journal "$begun" 'BUS_OFF cleared'
check "in the same process" [ "$(pid)" = "$before" ]

# ---- a camera of the kernel's own (vivid), pulled away and put back ----
sink can:vcan0
sed -i 's|^width = .*|width = 320|; s|^height = .*|height = 180|' /etc/voronoi-touch/index.toml # its smallest
program run --source v4l2:0 --config /etc/voronoi-touch/index.toml
systemctl restart $unit
check "a V4L2 camera: frames flow" frames vcan0 8
camera=$(basename "$(readlink -f /sys/class/video4linux/video0/device)")
before=$(pid)
listen vcan0,081:7FF
echo "$camera" >/sys/bus/platform/drivers/vivid/unbind
check "camera pulled out: emergency 0x5001 on the bus" heard '081 +\[8\] +01 50'
check "samples go on" frames vcan0 8
begun=$(now)
listen vcan0,081:7FF
echo "$camera" >/sys/bus/platform/drivers/vivid/bind
check "camera back: an emergency with code 0" heard '081 +\[8\] +00 00'
check "and the journal says so" journal "$begun" 'CAMERA_LOST cleared'
check "in the same process" [ "$(pid)" = "$before" ]
begun=$(now)
echo "$camera" >/sys/bus/platform/drivers/vivid/unbind
check "camera away for long: the watchdog starts the service anew, and one line says why" journal "$begun" 'error: source v4l2:0: no such camera'
listen vcan0,701:7FF
echo "$camera" >/sys/bus/platform/drivers/vivid/bind
check "camera back: it comes up by itself" heard '701 +\[1\] +00'
check "frames flow again" frames vcan0 8

# ---- UVC cameras on the kernel's own USB and driver, that show a recording; see uvc_camera.py ----
eval "exec ${adapter[1]}>&-" # the adapter ends
systemctl stop $unit
modprobe -a vhci-hcd uvcvideo
coproc cameras { exec "$python" /shared/deploy/sbc/uvc_camera.py $recording/press.mcap; }
camera() { # command
    echo "$*" >&"${cameras[1]}"
    read -r -t 300 answer <&"${cameras[0]}" && [ "$answer" = answered ]
}
compare() { timeout 600 "$python" /shared/deploy/sbc/uvc_values.py "$@"; }
of_port() { echo "/dev/v4l/by-path/platform-vhci_hcd.0-usb-0:$(($1 + 1)):1.0-video-index0"; }
"$python" -m edge replay $recording/press.mcap --speed max --sink memory: --samples -q \
    --calibration $recording/rings331_ball.json >/run/replayed
check "the replayed values are those of the processor that runs QEMU, to 1e-9" \
    compare equal /run/replayed /shared/deploy/sbc/.cache/replayed
show "largest difference, of its size" cat /run/check.out
camera plug 0
check "a UVC camera is plugged in: uvcvideo and udev have it" udevadm wait --timeout=100 "$(of_port 0)"
for format in YUYV:0 MJPG:1; do
    check "${format%:*}: its images are the recording's, within ${format#*:} levels" \
        compare images $recording/press.mcap "v4l2:Fingertip?format=${format%:*}" "${format#*:}"
    show "largest difference" cat /run/check.out
done
sed -i 's|^width = .*|width = 320|; s|^height = .*|height = 320|' /etc/voronoi-touch/index.toml
for format in YUYV:0.02 MJPG:0.05; do
    camera rest
    program run --source "v4l2:Fingertip?format=${format%:*}" --config /etc/voronoi-touch/index.toml \
        --calibration $recording/rings331_ball.json
    systemctl restart $unit
    check "v4l2:Fingertip finds it by name, ${format%:*}: the tip is untouched" compare untouched /run/replayed 0.1
    camera press
    check "pressed: values as of the recording replayed, within ${format#*:} mm" \
        compare pressed /run/replayed "${format#*:}"
    show "largest differences" cat /run/check.out
done
before=$(pid)
listen vcan0,081:7FF
camera unplug 0
check "its plug is pulled: emergency 0x5001 on the bus" heard '081 +\[8\] +01 50'
listen vcan0,081:7FF
camera plug 0
camera press
check "plugged in again: an emergency with code 0" heard '081 +\[8\] +00 00'
check "the same values as before" compare pressed /run/replayed 0.05
check "in the same process" [ "$(pid)" = "$before" ]
camera plug 1
udevadm wait --timeout=100 "$(of_port 1)"
for name in 0001 Fingertip; do
    "$python" -m edge run --source v4l2:$name --sink memory: --frames 1 >/run/two 2>&1
    check "two with one serial number: v4l2:$name is refused" [ $? = 2 ]
    check "both are named by their sockets" sh -c "grep -F '$(of_port 0)' /run/two | grep -qF '$(of_port 1)'"
    show "the refusal" grep error: /run/two
done
check "a camera in use: a second program says so and ends" sh -c \
    "$python -m edge run --source $(of_port 0) --sink memory: --frames 1 2>&1 | tee /run/two | grep 'another program uses it'"
check "by its socket, the second one runs" "$python" -m edge run --source "$(of_port 1)" --sink memory: --frames 1 -q

# ---- end, away (upgrade and roll back: tests/deploy) ----
check "stop" systemctl stop $unit
check "ended cleanly" sh -c "[ \$(systemctl show -p Result --value $unit) = success ]"
show "systemctl status after the end" systemctl status --no-pager -n 3 $unit
# ---- the app of an OAK4 on its M8 box: a container with the module's can0, and its devices as oakapp.toml mounts them ----
if [ $# -ge 2 ]; then
    root=/run/container
    mkdir -p /app $root
    sed "s|^spec = .*|spec = \"$(of_port 1)\"|; s|^directory = .*|directory = \"\"|; s|^sinks = .*|sinks = [\"can:$1?fd=0\"]|" \
        /etc/voronoi-touch/index.toml >/app/edge.toml
    mount --bind / $root
    mount --bind /dev $root/dev
    start=$("$python" -c 'import sys, tomllib; print(tomllib.load(sys.stdin.buffer)["entrypoint"][2])' </shared/deploy/oakapp.toml)
    PATH=$(dirname $python):$PATH unshare --mount --pid --fork --kill-child=TERM --mount-proc=$root/proc chroot $root bash -c "$start" &
    check "an app in a container: classic frames on its $1" frames "$2" 8
    kill -KILL $!
    umount $root/dev $root
fi

sum=$(cat /etc/voronoi-touch/index.toml /var/lib/voronoi-touch/index/* | md5sum)
check "uninstall" sh /shared/deploy/install.sh --uninstall
check "configuration and settings are as before" [ "$(cat /etc/voronoi-touch/index.toml /var/lib/voronoi-touch/index/* | md5sum)" = "$sum" ]
check "the software is gone" [ ! -e /opt/voronoi-touch ]
check "the unit is gone" sh -c "! systemctl cat $unit"
show "kernel complaints" sh -c "dmesg -l emerg,alert,crit,err | tail -n 5"
echo "DONE"
