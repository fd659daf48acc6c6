"""Answers of ``maniport live``, lines of JSON that arrive at a UDP port; needs neither LeRobot nor maniport."""

import json
import socket
import time

QUESTION = b"{}"  # is answered by the first line, with names and units of joints
QUESTION_PERIOD = 0.2  # [s]
LARGEST = 65536  # bytes of a datagram
MOST = 1000  # datagrams that are read at once; more come only from a flood


class Answers:
    """The port to which ``maniport live --udp UDP --send SEND`` sends its answers.

    Parameters
    ----------
    host : str
    udp, send : int
        Ports of ``maniport live``.

    Attributes
    ----------
    errors : list of str
        Messages of lines that could not be read there, the last ten.
    """

    def __init__(self, host: str, udp: int, send: int):
        self._server = (host, udp)
        self.errors: list[str] = []
        self._socket = socket.socket(socket.AF_INET, socket.SOCK_DGRAM)
        try:
            self._socket.bind((host, send))
        except OSError as error:
            self._socket.close()
            raise ConnectionError(
                f"the port {send} of {host} cannot be listened to: {error.strerror}"
            ) from None

    def close(self) -> None:
        """Close the port."""
        self._socket.close()

    def first_line(self, timeout: float) -> dict[str, object]:
        """Ask for the first line, with ``units`` and ``start`` of the joints; `ConnectionError` without an answer."""
        end = time.monotonic() + timeout
        while time.monotonic() < end:
            self._socket.sendto(QUESTION, self._server)
            asked = time.monotonic()
            while time.monotonic() < min(asked + QUESTION_PERIOD, end):
                self._socket.settimeout(QUESTION_PERIOD)
                answer = self._receive()
                if answer is not None and "units" in answer and "start" in answer:
                    return answer
        reason = "start it with --udp and --send of these ports, and the sensor last"
        if self.errors:
            reason = self.errors[-1]
        raise ConnectionError(
            f"maniport live at {self._server[0]}:{self._server[1]} did not name its joints: {reason}"
        )

    def newest_joints(self) -> dict[str, float] | None:
        """Return the joints of the newest answer that has arrived [rad or m]; None without a new one."""
        joints = None
        self._socket.settimeout(0.0)
        for _ in range(MOST):
            answer = self._receive()
            if answer is None:
                break
            found = answer.get("joints")
            if isinstance(found, dict):
                joints = {str(name): float(value) for name, value in found.items()}
        return joints

    def _receive(self) -> dict[str, object] | None:
        """Return the next answer; an empty one for what is none, None where nothing has arrived."""
        try:
            content, sender = self._socket.recvfrom(LARGEST)
        except (BlockingIOError, TimeoutError, ConnectionError):
            return None
        if sender[1] != self._server[1]:  # another program
            return {}
        try:
            answer = json.loads(content)
        except ValueError:
            return {}
        if not isinstance(answer, dict):
            return {}
        if "error" in answer:
            self.errors = [*self.errors[-9:], str(answer["error"])]
        return answer
