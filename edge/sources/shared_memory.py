"""Messages with large arrays from one process to another, without ever waiting.

A message is pickled, its arrays out of band (protocol 5). Both are copied once, into a ring of memory that
the two processes share; a packet on a socket, which holds few bytes, says where. How far the reader is
stands before the ring.

The memory has no name (memfd): nothing is left behind when a process dies. Pickle is safe here: the socket
pair is inherited, no other process can write to it.
"""

import mmap
import os
import pickle
import socket
from typing import Any

ALIGN = 64  # a cache line


class Outbox:
    """The sending end. Raises OSError: no memory, or a limit on the size of files, which holds for it too."""

    def __init__(self, size_bytes: int) -> None:
        self.fd = os.memfd_create("edge-worker")
        try:
            os.ftruncate(self.fd, ALIGN + size_bytes)
            self._read_n, self._ring = _mapped(self.fd)
        except OSError as error:
            os.close(self.fd)
            name = f"shared memory of {size_bytes / 1e6:.0f} MB"
            raise OSError(error.errno, error.strerror, name) from None
        self._written_n = 0
        self._socket, self.far_end = socket.socketpair(socket.AF_UNIX, socket.SOCK_SEQPACKET)
        self._socket.setblocking(False)

    def put(self, message: Any) -> bool:
        """Send, from one thread at a time; False: the memory is full, or the other side has closed."""
        arrays: list[pickle.PickleBuffer] = []
        text = pickle.dumps(message, protocol=5, buffer_callback=arrays.append)
        parts = [memoryview(text), *(array.raw() for array in arrays)]
        need, size = sum(_aligned(part.nbytes) for part in parts), len(self._ring)
        begin = self._written_n
        if begin % size + need > size:  # what a message has does not wrap
            begin += size - begin % size
        read_n = self._read_n[0]
        if need + (begin - read_n if read_n < self._written_n else 0) > size:
            return False
        at = begin % size
        for part in parts:
            self._ring[at : at + part.nbytes] = part
            at += _aligned(part.nbytes)
        try:
            self._socket.send(pickle.dumps((begin, [part.nbytes for part in parts])))
        except OSError:  # full, or closed at the other end
            return False
        self._written_n = begin + need
        return True

    def close(self) -> None:
        """Send nothing more; messages already sent can still be read."""
        self._socket.close()
        self.far_end.close()
        os.close(self.fd)


class Inbox:
    """The receiving end, of the inherited `far_end` and `fd` of an `Outbox`."""

    def __init__(self, connection: socket.socket, fd: int) -> None:
        self._socket = connection
        self._read_n, self._ring = _mapped(fd)
        os.close(fd)  # the mapping holds it

    def get(self) -> Any:
        """Wait for the next message; its arrays are copies. None: the other side has closed or died."""
        packet = self._socket.recv(self._socket.getsockopt(socket.SOL_SOCKET, socket.SO_RCVBUF))
        if not packet:
            return None
        begin, lengths = pickle.loads(packet)
        at, parts = begin % len(self._ring), []
        for length in lengths:
            parts.append(bytearray(self._ring[at : at + length]))
            at += _aligned(length)
        self._read_n[0] = begin + sum(map(_aligned, lengths))
        return pickle.loads(parts[0], buffers=parts[1:])


def _mapped(fd: int) -> tuple[memoryview, memoryview]:
    """How many bytes the reader is done with, of all ever written; and the ring."""
    memory = memoryview(mmap.mmap(fd, os.fstat(fd).st_size))
    return memory[:8].cast("Q"), memory[ALIGN:]


def _aligned(n_bytes: int) -> int:
    return -(-n_bytes // ALIGN) * ALIGN
