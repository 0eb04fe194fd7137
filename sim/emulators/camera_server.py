"""The simulated camera as one on the network: motion JPEG over HTTP, on this machine only."""

from __future__ import annotations

import threading
import time
from functools import partial
from http.server import BaseHTTPRequestHandler, ThreadingHTTPServer
from types import TracebackType
from typing import Any

from sim.body.simulated_body import SimulatedBody
from sim.faults.built_in_faults import CameraUnplugged, DroppedFrames, LateFrames
from world_models.frames import Pose2

PATH = "/stream.mjpg"
BOUNDARY = "frame"
UNPLUGGED = CameraUnplugged.kind
NO_NEW_FRAME = frozenset((LateFrames.kind, DroppedFrames.kind))


class CameraServer:
    """Serves the pictures of a simulated body's camera to every client on this machine, from threads of its own.

    The camera has the body's faults: unplugged, it closes every connection and refuses new ones; late or dropped, it
    sends nothing. While nothing moves the same picture is sent again, with the same noise, which saves rendering.
    """

    def __init__(self, body: SimulatedBody, port: int = 0, rate_hz: float = 10.0) -> None:
        """``port`` 0 takes a free one. Raises OSError where the port is in use."""
        self._server = ThreadingHTTPServer(("127.0.0.1", port), partial(_Handler, body, 1.0 / rate_hz))
        self._server.daemon_threads = True
        self._thread = threading.Thread(target=self._server.serve_forever, args=(0.1,), name="camera", daemon=True)

    @property
    def url(self) -> str:
        """What to give to VideoCapture."""
        return f"http://127.0.0.1:{self._server.server_address[1]}{PATH}"

    def __enter__(self) -> CameraServer:
        self._thread.start()
        return self

    def __exit__(
        self, _kind: type[BaseException] | None, _error: BaseException | None, _trace: TracebackType | None
    ) -> None:
        self._server.shutdown()
        self._server.server_close()


class _Handler(BaseHTTPRequestHandler):
    """One client."""

    def __init__(self, body: SimulatedBody, every_s: float, *args: Any) -> None:
        self._body, self._every_s = body, every_s
        super().__init__(*args)

    def do_GET(self) -> None:
        """Send the stream until the client closes it or the camera is unplugged."""
        if self.path != PATH:
            self.send_error(404, f"expected {PATH}")
            return
        if UNPLUGGED in self._body.device_faults:
            self.send_error(503, "the camera is unplugged")
            return
        self.send_response(200)
        self.send_header("Content-Type", f"multipart/x-mixed-replace; boundary={BOUNDARY}")
        self.end_headers()
        try:
            self._stream()
        except OSError:
            return

    def _stream(self) -> None:
        due_s, jpeg = time.monotonic(), b""
        seen: tuple[Pose2, bool] | None = None
        while UNPLUGGED not in self._body.device_faults:
            if NO_NEW_FRAME.isdisjoint(self._body.device_faults):
                truth = self._body.truth
                if (truth.world_from_robot, truth.lights_on) != seen:
                    seen, jpeg = (truth.world_from_robot, truth.lights_on), self._body.picture()
                head = f"--{BOUNDARY}\r\nContent-Type: image/jpeg\r\nContent-Length: {len(jpeg)}\r\n\r\n"
                self.wfile.write(head.encode("ascii") + jpeg + b"\r\n")
            due_s = max(due_s + self._every_s, time.monotonic())
            time.sleep(max(0.0, due_s - time.monotonic()))

    def log_message(self, *_args: Any) -> None:
        """Requests are not logged."""
