"""Hostile readers of an executive: slow, incomplete, reconnecting and unauthorized clients.

    python3 testing/day/hostile.py PORT COUNT

runs until it is killed.
"""

import random
import socket
import sys
import threading
import time


def slow_stream(peer, dice):
    """Requests all events and reads a few bytes a second."""
    peer.sendall(b"GET /v1/events?after=0 HTTP/1.1\r\nHost: localhost\r\n\r\n")
    for _ in range(dice.randrange(20, 200)):
        if not peer.recv(16):
            return
        time.sleep(0.2)


def half_request(peer, dice):
    """Sends a request that never ends."""
    peer.sendall(b"POST /v1/goals HTTP/1.1\r\nHost: localhost\r\nContent-Length: 1000000\r\n\r\n{"[: dice.randrange(1, 80)])
    time.sleep(dice.uniform(0, 8))


def reconnecting(peer, dice):
    """Requests the state and leaves without reading the answer."""
    peer.sendall(b"GET /v1/state/events HTTP/1.1\r\nHost: localhost\r\n\r\n")
    time.sleep(dice.uniform(0.05, 0.5))


def garbage(peer, dice):
    """Sends bytes that are no request."""
    peer.sendall(dice.randbytes(dice.randrange(1, 4000)))
    time.sleep(dice.uniform(0.1, 1))


def unauthorized(peer, dice):
    """Requests a stop without the token."""
    peer.sendall(b"POST /v1/stop HTTP/1.1\r\nHost: localhost\r\nContent-Length: 0\r\n\r\n")
    peer.recv(1000)
    time.sleep(dice.uniform(0.1, 1))


KINDS = [slow_stream, half_request, reconnecting, garbage, unauthorized]


def reader(port, number):
    dice = random.Random(number)
    while True:
        try:
            with socket.create_connection(("127.0.0.1", port), timeout=5) as peer:
                KINDS[number % len(KINDS)](peer, dice)
        except OSError:
            pass
        time.sleep(dice.uniform(0.05, 0.3))


def main():
    port, count = int(sys.argv[1]), int(sys.argv[2])
    for number in range(count):
        threading.Thread(target=reader, args=(port, number), daemon=True).start()
    threading.Event().wait()


if __name__ == "__main__":
    main()
