"""Client of the HTTP interface of `elbowroom serve` (docs/reference/serve.md), over TCP or a Unix socket."""

import http.client
import json
import socket


class Unreachable(Exception):
    """The executive does not answer, or not as expected."""

    def __init__(self, message, status=None):
        super().__init__(message)
        self.status = status


class SocketConnection(http.client.HTTPConnection):
    """HTTP over a Unix socket."""

    def __init__(self, path, timeout):
        super().__init__("localhost", timeout=timeout)
        self._path = path

    def connect(self):
        self.sock = socket.socket(socket.AF_UNIX, socket.SOCK_STREAM)
        self.sock.settimeout(self.timeout)
        self.sock.connect(self._path)


class Client:
    """Executive at an address: `HOST:PORT`, a port, or the path of a Unix socket. Each request is a connection."""

    def __init__(self, address, token=None):
        self.address, self.token = address, token

    def request(self, method, path, body=None, timeout=30):
        """Sends a request. Returns the status and the document of the answer."""
        connection = self._connection(timeout)
        try:
            answer = self._send(connection, method, path, body)
            return answer.status, json.loads(answer.read() or b"{}")
        except (OSError, http.client.HTTPException, ValueError) as error:
            raise Unreachable(f"{self.address}: {error}") from None
        finally:
            connection.close()

    def stream(self, path, timeout=10):
        """Sends a request, and returns the events of the answer as they come: name, number and data."""
        connection = self._connection(timeout)
        try:
            answer = self._send(connection, "GET", path, None)
            if answer.status != 200:
                raise Unreachable(f"{self.address}: status {answer.status} for {path}", answer.status)
            event = {}
            for line in answer:
                key, _, value = line.decode().rstrip("\r\n").partition(": ")
                if key.startswith(":"):
                    continue  # a comment, to detect clients that have gone
                if key:
                    event[key] = value
                elif event:
                    yield event.get("event", ""), event.get("id"), event.get("data", "")
                    event = {}
        except (OSError, http.client.HTTPException, ValueError) as error:
            raise Unreachable(f"{self.address}: {error}") from None
        finally:
            connection.close()

    def _connection(self, timeout):
        if "/" in self.address:
            return SocketConnection(self.address, timeout)
        host, _, port = self.address.rpartition(":")
        return http.client.HTTPConnection(host or "127.0.0.1", int(port), timeout=timeout)

    def _send(self, connection, method, path, body):
        headers = {} if self.token is None else {"Authorization": f"Bearer {self.token}"}
        connection.request(method, path, None if body is None else json.dumps(body), headers)
        return connection.getresponse()


def merge(document, patch):
    """Applies a merge patch (RFC 7396) to a document. Returns the new document."""
    if not isinstance(patch, dict):
        return patch
    merged = dict(document) if isinstance(document, dict) else {}
    for name, value in patch.items():
        if value is None:
            merged.pop(name, None)
        else:
            merged[name] = merge(merged.get(name), value)
    return merged
