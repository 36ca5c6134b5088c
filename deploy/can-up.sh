#!/bin/sh
# Brings a CAN interface up, where systemd-networkd does not do it; as root.
#
#   can-up.sh [INTERFACE [BITRATE [DBITRATE]]]     can0, 1000000 and 5000000 where nothing is said
#
# DBITRATE is CAN FD's data phase; 0: classic CAN. The same settings as 80-voronoi-touch-can.network.
set -eu

fail() {
    echo "can-up: $*" >&2
    exit 2
}

case ${1:-} in
-h | --help)
    sed -n '2,/^set -eu/s/^# \{0,1\}//p' "$0"
    exit 0
    ;;
-*) fail "unknown option $1; see --help" ;;
esac
interface=${1:-can0}
bitrate=${2:-1000000}
dbitrate=${3:-5000000}
[ $# -le 3 ] || fail "$4: one word too many; see --help"
case $bitrate in *[!0-9]* | 0) fail "BITRATE $bitrate: bit/s, e.g. 1000000" ;; esac
case $dbitrate in *[!0-9]*) fail "DBITRATE $dbitrate: bit/s, e.g. 5000000, or 0 for classic CAN" ;; esac
command -v ip >/dev/null || fail "ip is missing: apt-get install iproute2"

if ! ip link show dev "$interface" >/dev/null 2>&1; then
    here=$(ip -br link show type can 2>/dev/null | cut -d' ' -f1 | tr '\n' ' ')
    fail "no interface $interface; CAN interfaces here: ${here:-none}; a hat needs its dtoverlay line and a restart"
fi
ip link set dev "$interface" down
if ip -details link show dev "$interface" | grep -q ' vcan '; then
    ip link set dev "$interface" mtu 72 # CAN FD frames; a virtual bus has no bit rate
elif [ "$dbitrate" -gt 0 ]; then
    ip link set dev "$interface" type can bitrate "$bitrate" sample-point 0.8 \
        dbitrate "$dbitrate" dsample-point 0.8 fd on restart-ms 100
else
    ip link set dev "$interface" type can bitrate "$bitrate" sample-point 0.8 restart-ms 100
fi
ip link set dev "$interface" up
ip -details -brief link show dev "$interface"
