#!/bin/sh
# Brings a CAN interface up, where systemd-networkd does not do it: can-up.sh [INTERFACE [BITRATE [DBITRATE]]]
# DBITRATE 0: classic CAN. The same settings as 80-voronoi-touch-can.network.
set -eu
interface=${1:-can0}
bitrate=${2:-1000000}
dbitrate=${3:-5000000}

if ! ip link show dev "$interface" >/dev/null 2>&1; then
    echo "can-up: no interface $interface; here are: $(ip -br link show type can | cut -d' ' -f1 | tr '\n' ' ')" >&2
    exit 2
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
