"""Pages that solve by themselves on the site: in place of a picture that links to one, a guide shows the page itself."""

from __future__ import annotations

import re
from typing import Any

PICTURE = re.compile(r'<a href="([^"]*pages/live_\w+\.html)"><img alt="([^"]*)" src="[^"]*" ?/?></a>')
FRAME = r'<iframe class="live" src="\1" title="\2" loading="lazy"></iframe><a class="live" href="\1">Open it alone</a>'


def on_page_content(text: str, **_: Any) -> str:
    """Put a frame in place of each such picture."""
    return PICTURE.sub(FRAME, text)
