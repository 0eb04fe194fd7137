"""What a report's page holds, read back from its text."""

from __future__ import annotations

import base64
import gzip
import json
import re
from typing import Any


def read_contents(page: str) -> Any:
    """The JSON that the page unpacks."""
    found = re.search(r'<script id="data" type="application/gzip">(.*?)</script>', page, re.DOTALL)
    assert found is not None
    return json.loads(gzip.decompress(base64.b64decode(found[1])))
