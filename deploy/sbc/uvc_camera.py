"""UVC cameras that show a recording; runs on the emulated board.

The kernel's virtual USB host (`vhci_hcd`, of USB/IP) takes a device's traffic from a socket. This program is
at the other end and answers as a camera does: descriptors, requests, isochronous packets. From there on
everything is the kernel's own: USB core, uvcvideo, udev, V4L2. Its UVC gadget would not do: `dummy_hcd`, the
only controller for gadgets that is no hardware, has no endpoint for it ("Unable to allocate streaming EP").

All cameras are of one model and have one serial number. Each shows the first images of the recording, those
of the untouched tip, again and again. Commands, a line
each on standard input, each answered by a line:
    plug N      camera N, of 0 to 7, appears
    unplug N    it is pulled out
    press       all play the rest of the recording, and then its end again and again
    rest        all show the untouched tip

Sources: USB 2.0, chapter 9; USB Video Class 1.0; Linux, Documentation/usb/usbip_protocol.rst.
"""

from __future__ import annotations

import errno
import select
import socket
import sys
import time
from collections import deque
from math import inf
from pathlib import Path
from struct import Struct, pack, unpack

import cv2
import numpy as np

from edge.sources import open_source
from edge.types import Image

VHCI = Path("/sys/devices/platform/vhci_hcd.0/attach")
HIGH_SPEED = 3  # linux/usb/ch9.h
SUBMIT, UNLINK, SUBMITTED, UNLINKED = 1, 2, 3, 4  # commands of USB/IP, and their answers
# Command, number, device, inwards, endpoint; flags, length, -, packets, -, setup.
REQUEST = Struct(">5I Iiiii8s")
ANSWER = Struct(">5I iiiii8x")  # command, number, -, -, -; status, length, -, packets, faulty ones
PACKET = Struct(">3Ii")  # isochronous: start in the buffer, length, of it used, status

UNTOUCHED_N, HELD_N = 8, 5  # images at the recording's beginning, and at its end
INTERVAL_S = 0.4  # between images: an emulated processor computes no more
PACKET_BYTES = 3 * 1024  # the most that a high-speed endpoint carries in a microframe
END_OF_HEADER, END_OF_IMAGE = 0x80, 0x02  # of a payload's header; its lowest bit tells images apart
STRINGS = (
    "\u0409",
    "voronoi-touch",
    "Fingertip camera",
    "0001",
)  # language (English), maker, product, serial number
MJPG, YUYV = 1, 2  # formats, by their numbers in the descriptors
YUY2 = b"YUY2\0\0\x10\0\x80\0\0\xaa\0\x38\x9b\x71"  # its GUID


def described(kind: int, *parts: bytes) -> bytes:
    """A descriptor: its length, its kind, what it says."""
    body = b"".join(parts)
    return bytes([len(body) + 2, kind]) + body


def descriptors(width: int, height: int) -> tuple[bytes, bytes]:
    """Of the device, and of its configuration: a control interface, and one that streams."""
    device = described(1, pack("<H4B3H4B", 0x0200, 0xEF, 2, 1, 64, 0x1D6B, 0x0104, 0x0100, 1, 2, 3, 1))
    most, interval = 2 * width * height, round(INTERVAL_S * 1e7)
    frame = pack("<BHHIIIIBI", 0, width, height, most * 8, most * 24, most, interval, 1, interval)
    color = described(0x24, bytes([0x0D, 1, 1, 4]))
    formats = [
        described(0x24, bytes([0x06, MJPG, 1, 1, 1, 0, 0, 0, 0])), described(0x24, b"\x07\x01", frame), color,
        described(0x24, bytes([0x04, YUYV, 1]), YUY2, bytes([16, 1, 0, 0, 0, 0])),
        described(0x24, b"\x05\x01", frame), color,
    ]  # fmt: skip
    inputs = 15 + sum(map(len, formats))
    terminals = [
        described(0x24, pack("<BBHBB3HB3B", 0x02, 1, 0x0201, 0, 0, 0, 0, 0, 3, 0, 0, 0)),  # the lens
        described(0x24, pack("<BBHBBB", 0x03, 2, 0x0101, 0, 1, 0)),  # the stream
    ]
    parts = [
        described(0x0B, bytes([0, 2, 0x0E, 3, 0, 2])),  # the two interfaces are one function
        described(4, bytes([0, 0, 0, 0x0E, 1, 0, 0])),
        described(0x24, pack("<BHHIBB", 1, 0x0100, 13 + sum(map(len, terminals)), 48_000_000, 1, 1)),
        *terminals,
        described(4, bytes([1, 0, 0, 0x0E, 2, 0, 0])),
        described(0x24, pack("<BBHB7B", 1, 2, inputs, 0x81, 0, 2, 0, 0, 0, 1, 0), b"\0"),
        *formats,
        described(4, bytes([1, 1, 1, 0x0E, 2, 0, 0])),  # the same with bandwidth
        described(5, pack("<BBHB", 0x81, 5, 2 << 11 | 1024, 1)),
    ]
    body = b"".join(parts)
    return device, described(2, pack("<H5B", 9 + len(body), 2, 1, 0, 0x80, 250)) + body


def encoded(image: Image) -> dict[int, bytes]:
    """The image in each format."""
    yuyv = np.full((*image.shape, 2), 128, np.uint8)
    yuyv[:, :, 0] = image
    jpeg = cv2.imencode(".jpg", cv2.cvtColor(image, cv2.COLOR_GRAY2BGR), [cv2.IMWRITE_JPEG_QUALITY, 95])[1]
    return {MJPG: jpeg.tobytes(), YUYV: yuyv.tobytes()}


class Camera:
    """The device's end of a plugged cable."""

    def __init__(self, port: int, images: list[dict[int, bytes]], size_px: tuple[int, int]) -> None:
        self.images, self.pressed = images, False
        self.device, self.configuration = descriptors(*size_px)
        most, interval = 2 * size_px[0] * size_px[1], round(INTERVAL_S * 1e7)
        self.terms = pack("<HBBI5HII", 0, MJPG, 1, interval, *[0] * 5, most, PACKET_BYTES)  # of the stream
        self.waiting: deque[tuple[int, bytes]] = deque()  # requests for images: numbers and packets
        self.payloads: deque[bytes] = deque()  # of the image that is on its way
        self.due_s, self.shown_n, self.mark = inf, 0, 0
        self.socket, theirs = socket.socketpair()
        with theirs:
            VHCI.write_text(f"{port} {theirs.fileno()} {port + 1} {HIGH_SPEED}")

    def press(self, pressed: bool) -> None:
        self.pressed, self.shown_n = pressed, UNTOUCHED_N if pressed else 0

    def next_image(self) -> None:
        """Cut it into payloads, in the format that was agreed on."""
        n, end = self.shown_n, len(self.images)
        if not self.pressed:
            n %= UNTOUCHED_N
        elif n >= end:
            n = end - HELD_N + (n - end) % HELD_N
        self.shown_n, self.mark = self.shown_n + 1, self.mark ^ 1
        data, room = self.images[n][self.terms[2]], PACKET_BYTES - 2
        for start in range(0, len(data), room):
            last = END_OF_IMAGE if start + room >= len(data) else 0
            self.payloads.append(bytes([2, END_OF_HEADER | last | self.mark]) + data[start : start + room])

    def control(self, kind: int, request: int, value: int, index: int, data: bytes) -> bytes | None:
        """Answer to a request; None: it has none."""
        agree = index == 1 and value >> 8 in (1, 2)  # probe, commit
        match kind, request:
            case 0x80, 6 if value >> 8 in (1, 2):
                return (self.device, self.configuration)[(value >> 8) - 1]
            case 0x80, 6 if value >> 8 == 3 and value & 0xFF < len(STRINGS):
                return described(3, STRINGS[value & 0xFF].encode("utf-16-le"))
            case 0x80, 0:  # its state, after sleep
                return bytes(2)
            case 0x00, 9:  # the configuration
                return b""
            case 0x01, 11:  # an interface, with bandwidth or without
                self.payloads.clear()
                self.due_s = time.monotonic() if value else inf
                return b""
            case 0x21, 0x01 if agree:  # SET_CUR
                self.terms = self.terms[:2] + data[2:4] + self.terms[4:]
                return b""
            case 0xA1, 0x85 if agree:  # GET_LEN
                return pack("<H", len(self.terms))
            case 0xA1, 0x86 if agree:  # GET_INFO: can be read and written
                return b"\3"
            case 0xA1, _ if agree:  # GET_CUR, GET_MIN, ...
                return self.terms
        return None

    def answer(
        self, number: int, length: int, body: bytes = b"", packets_n: int = 0, status: int = 0
    ) -> None:
        self.socket.sendall(ANSWER.pack(SUBMITTED, number, 0, 0, 0, status, length, 0, packets_n, 0) + body)

    def take(self, n: int) -> bytes:
        return self.socket.recv(n, socket.MSG_WAITALL) if n else b""

    def serve(self) -> None:
        """Take one command of the host's."""
        head = self.take(REQUEST.size)
        command, number, _, inwards, endpoint, first, length, _, packets_n, _, setup = REQUEST.unpack(head)
        if command == UNLINK:  # what is not answered yet is not going to be
            before = len(self.waiting)
            self.waiting = deque(entry for entry in self.waiting if entry[0] != first)
            status = -errno.ECONNRESET if len(self.waiting) < before else 0
            self.socket.sendall(ANSWER.pack(UNLINKED, number, 0, 0, 0, status, 0, 0, 0, 0))
            return
        data = b"" if inwards else self.take(length)
        if endpoint:
            self.waiting.append((number, self.take(packets_n * PACKET.size)))
            return
        kind, request, value, index, _ = unpack("<BBHHH", setup)
        reply = self.control(kind, request, value, index, data)
        if reply is None:
            self.answer(number, 0, status=-errno.EPIPE)
        elif inwards:
            self.answer(number, len(reply[:length]), reply[:length])
        else:
            self.answer(number, length)

    def stream(self) -> None:
        """Fill what waits, as far as there is something to be seen."""
        while self.waiting and (self.payloads or self.due_s <= time.monotonic()):
            if not self.payloads:
                self.next_image()
                self.due_s = max(self.due_s + INTERVAL_S, time.monotonic())
            number, packets = self.waiting.popleft()
            data, used = b"", b""
            for start, room, _, _ in PACKET.iter_unpack(packets):
                payload = self.payloads.popleft() if self.payloads else b""
                data += payload
                used += PACKET.pack(start, room, len(payload), 0)
            self.answer(number, len(data), data + used, len(packets) // PACKET.size)


def main(recording: str) -> None:
    """Serve until standard input ends."""
    images = [frame.image for frame in open_source(recording)]
    height, width = images[0].shape
    shown = [encoded(image) for image in images]
    cameras: dict[int, Camera] = {}
    while True:
        due_s = min((camera.due_s for camera in cameras.values() if camera.waiting), default=inf)
        wait_s = None if due_s == inf else max(0.0, due_s - time.monotonic())
        readable, _, _ = select.select([sys.stdin, *(c.socket for c in cameras.values())], [], [], wait_s)
        for camera in cameras.values():
            if camera.socket in readable:
                camera.serve()
            camera.stream()
        if sys.stdin in readable:
            words = sys.stdin.readline().split()
            if not words:
                return
            match words:
                case "plug", port:
                    cameras[int(port)] = Camera(int(port), shown, (width, height))
                case "unplug", port:
                    cameras.pop(int(port)).socket.close()
                case (("press" | "rest") as what,):
                    for camera in cameras.values():
                        camera.press(what == "press")
            print("answered", flush=True)


if __name__ == "__main__":
    main(sys.argv[1])
