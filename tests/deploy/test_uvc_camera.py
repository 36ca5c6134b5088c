"""The emulated board's UVC camera, asked as a host asks it; in `make sbc-test` the kernel's drivers do."""

import os
import socket
from struct import pack
from types import SimpleNamespace

import numpy as np
import pytest

from deploy.sbc import uvc_camera
from deploy.sbc.uvc_camera import ANSWER, MJPG, PACKET, PACKET_BYTES, REQUEST, SUBMIT, YUYV, Camera, encoded

IMAGE = np.random.default_rng(7).integers(0, 256, (48, 64), dtype=np.uint8)


@pytest.mark.parametrize("chosen", [MJPG, YUYV])
def test_an_image_comes_whole_in_the_format_agreed_on(chosen: int, monkeypatch: pytest.MonkeyPatch) -> None:
    ends = []  # of the cable, as the kernel gets them
    attach = SimpleNamespace(write_text=lambda text: ends.append(os.dup(int(text.split()[1]))))
    monkeypatch.setattr(uvc_camera, "VHCI", attach)
    camera = Camera(0, [encoded(IMAGE)] * 13, (64, 48))
    with camera.socket, socket.socket(fileno=ends[0]) as host:
        for setup, data in (
            (pack("<BBHHH", 0x21, 1, 0x200, 1, 26), bytes([0, 0, chosen, 1]) + bytes(22)),
            (pack("<BBHHH", 1, 11, 1, 1, 0), b""),  # the setting with bandwidth
        ):
            host.sendall(REQUEST.pack(SUBMIT, 8, 1, 0, 0, 0, len(data), 0, 0, 0, setup) + data)
            camera.serve()
            assert ANSWER.unpack(host.recv(ANSWER.size))[1:6] == (8, 0, 0, 0, 0)
        packets = b"".join(PACKET.pack(n * PACKET_BYTES, PACKET_BYTES, 0, 0) for n in range(3))
        host.sendall(REQUEST.pack(SUBMIT, 9, 1, 1, 1, 0, 3 * PACKET_BYTES, 0, 3, 1, bytes(8)) + packets)
        camera.serve()
        camera.stream()
        length = ANSWER.unpack(host.recv(ANSWER.size))[6]
        data, used = host.recv(length, socket.MSG_WAITALL), host.recv(3 * PACKET.size, socket.MSG_WAITALL)
    image, marks = b"", b""
    for _, _, n, _ in PACKET.iter_unpack(used):
        payload, data = data[:n], data[n:]
        image, marks = image + payload[2:], marks + payload[1:2]
    assert image == encoded(IMAGE)[chosen]
    assert [mark & 2 for mark in marks] == [0] * (len(marks) - 1) + [2], "its end is marked"
