"""Messages with large arrays from one process to another, without ever waiting.

A message is pickled, its arrays out of band (protocol 5). Both are copied once into memory that the two
processes share, a ring of regions; a packet on a socket gives their places. A message without arrays is sent
in the packet itself. Messages with arrays come from one thread, others from any.

The memory has no name (memfd): nothing is left behind when a process dies. Pickle is safe here: the socket
pair is inherited, no other process can write to it.
"""

import mmap
import os
import pickle
import socket
import struct
from collections import deque
from contextlib import suppress
from typing import Any

ALIGN = 64  # a cache line
_HEAD = struct.Struct(
    "<QI"
)  # where the region begins, how many arrays; then the lengths of pickle and arrays


def pair() -> tuple[socket.socket, socket.socket]:
    """Two ends of a socket that keeps packets whole and in order."""
    return socket.socketpair(socket.AF_UNIX, socket.SOCK_SEQPACKET)


def receive(connection: socket.socket) -> bytes:
    """The next packet, waiting for it; empty: the other side has closed, and all it sent was read."""
    while True:
        try:
            return connection.recv(connection.getsockopt(socket.SOL_SOCKET, socket.SO_RCVBUF))
        except ConnectionResetError:  # raised once by a dead side, before packets that are still unread
            continue


class Outbox:
    """The sending end.

    size_bytes  of the memory for arrays
    Raises      OSError: no memory, or a limit on the size of files, which holds for shared memory, too
    """

    def __init__(self, size_bytes: int) -> None:
        self.fd = os.memfd_create("edge-worker")
        try:
            os.ftruncate(self.fd, size_bytes)
            self._memory = mmap.mmap(self.fd, size_bytes)
        except OSError as error:
            os.close(self.fd)
            name = f"shared memory of {size_bytes / 1e6:.0f} MB"
            raise OSError(error.errno, error.strerror, name) from None
        self._view = memoryview(self._memory)
        self._size = size_bytes
        self._regions: deque[tuple[int, int]] = deque()  # begin, end; not freed yet, oldest first
        self._socket, self.far_end = pair()
        self._socket.setblocking(False)

    def put(self, message: Any) -> bool:
        """Send; False: the memory is full, or the other side has closed."""
        buffers: list[pickle.PickleBuffer] = []
        text = pickle.dumps(message, protocol=5, buffer_callback=buffers.append)
        if not buffers:
            return self._send(_HEAD.pack(0, 0) + text)
        parts = [memoryview(text), *(buffer.raw() for buffer in buffers)]
        self._collect()
        begin = at = self._free_space(sum(_aligned(part.nbytes) for part in parts))
        if begin is None or at is None:
            return False
        for part in parts:
            self._view[at : at + part.nbytes] = part
            at += _aligned(part.nbytes)
        lengths = struct.pack(f"<{len(parts)}Q", *(part.nbytes for part in parts))
        if not self._send(_HEAD.pack(begin, len(buffers)) + lengths):
            return False
        self._regions.append((begin, at))
        return True

    def _send(self, packet: bytes) -> bool:
        try:
            self._socket.send(packet)
        except OSError:  # full, larger than a packet can be, or closed at the other end
            return False
        return True

    def _collect(self) -> None:
        """Free the regions that the other side has copied; it sends one byte for each."""
        while self._regions:
            try:
                freed = self._socket.recv(1)
            except OSError:
                return
            if not freed:
                return
            self._regions.popleft()

    def _free_space(self, size: int) -> int | None:
        """Begin of a contiguous free region of this size."""
        if not self._regions:
            return 0 if size <= self._size else None
        oldest, last = self._regions[0][0], self._regions[-1][1]
        if last > oldest:
            if size <= self._size - last:
                return last
            last = 0
        return last if size <= oldest - last else None

    def close(self) -> None:
        """Send nothing more; messages already sent can still be read."""
        self._socket.close()
        self.far_end.close()
        self._view.release()
        self._memory.close()
        os.close(self.fd)


class Inbox:
    """The receiving end.

    connection, fd  as inherited from the process of the `Outbox`: its `far_end` and `fd`
    """

    def __init__(self, connection: socket.socket, fd: int) -> None:
        self._socket = connection
        self._memory = memoryview(mmap.mmap(fd, os.fstat(fd).st_size, prot=mmap.PROT_READ))
        os.close(fd)  # the mapping holds it

    def get(self) -> Any:
        """Wait for the next message; its arrays are copies. None: the end."""
        packet = receive(self._socket)
        if not packet:
            return None
        at, n = _HEAD.unpack_from(packet)
        if not n:
            return pickle.loads(packet[_HEAD.size :])
        parts = []
        for length in struct.unpack_from(f"<{n + 1}Q", packet, _HEAD.size):
            parts.append(bytearray(self._memory[at : at + length]))
            at += _aligned(length)
        with suppress(OSError):  # the other side has closed; its messages can still be read
            self._socket.send(b".")
        return pickle.loads(parts[0], buffers=parts[1:])


def _aligned(n_bytes: int) -> int:
    return -(-n_bytes // ALIGN) * ALIGN
