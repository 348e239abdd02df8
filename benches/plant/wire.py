"""A client of HTTP/1.1 that takes little of the processor: requests are bytes made beforehand, and of an answer only
the status and the body are read."""

import re
import socket

LENGTH = re.compile(rb"\r\ncontent-length: (\d+)")
PIECE_BYTES = 1 << 16


def request(method, path, token=None, body=b"", media_type=None, headers=()):
    """A whole request as bytes."""
    lines = [f"{method} {path} HTTP/1.1", "host: 127.0.0.1", *headers]
    if token:
        lines.append(f"authorization: Bearer {token}")
    if media_type:
        lines += [f"content-type: {media_type}", f"content-length: {len(body)}"]
    return "\r\n".join(lines).encode() + b"\r\n\r\n" + body


class Wire:
    """A connection that is opened when it is needed, and again after it ended."""

    def __init__(self, address, source=None, timeout=60):
        self.address, self.source, self.timeout = address, source, timeout
        self.socket, self.buffer = None, bytearray()

    def open(self):
        self.buffer.clear()
        source = (self.source, 0) if self.source else None
        self.socket = socket.create_connection(self.address, self.timeout, source)
        self.socket.setsockopt(socket.IPPROTO_TCP, socket.TCP_NODELAY, 1)

    def close(self):
        if self.socket is not None:
            self.socket.close()
            self.socket = None

    def ask(self, text):
        """Status and body of an answer; status 0 and the reason where the connection broke off."""
        try:
            self.send(text)
            return self.answer()
        except (OSError, ValueError) as error:
            self.close()
            return 0, repr(error).encode()

    def pipelined(self, texts):
        """The statuses of requests that are sent together; of those that are not answered there is none."""
        statuses = []
        try:
            self.send(b"".join(texts))
            for _ in texts:
                statuses.append(self.answer()[0])
                if self.socket is None:
                    break
        except (OSError, ValueError):
            self.close()
        return statuses

    def send(self, text):
        if self.socket is None:
            self.open()
        self.socket.sendall(text)

    def answer(self):
        while (end := self.buffer.find(b"\r\n\r\n")) < 0:
            self.receive()
        head = bytes(self.buffer[:end]).lower()
        del self.buffer[:end + 4]
        status = int(head[9:12])
        length = LENGTH.search(head)
        if b"\r\ntransfer-encoding: chunked" in head:
            body = self.chunks()
        else:
            body = self.exactly(int(length[1])) if length else b""
        if b"\r\nconnection: close" in head:
            self.close()
        return status, body

    def chunks(self):
        pieces = []
        while True:
            size = int(self.line(), 16)
            piece = self.exactly(size + 2)[:-2]
            if size == 0:
                return b"".join(pieces)
            pieces.append(piece)

    def line(self):
        while (end := self.buffer.find(b"\r\n")) < 0:
            self.receive()
        text = bytes(self.buffer[:end])
        del self.buffer[:end + 2]
        return text

    def exactly(self, count):
        while len(self.buffer) < count:
            self.receive()
        body = bytes(self.buffer[:count])
        del self.buffer[:count]
        return body

    def receive(self):
        piece = self.socket.recv(PIECE_BYTES)
        if not piece:
            raise ConnectionResetError("the connection ended before the answer did")
        self.buffer += piece
