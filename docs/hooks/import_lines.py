"""The line that imports each name of the Python pages, under its heading."""

from __future__ import annotations

import importlib
import re
from typing import Any

# Where users find names, the shortest first.
PUBLIC = (
    "ripple_sim",
    "ripple_sim.gymnasium",
    "ripple_sim.dm_control",
    "ripple_sim.solver",
    "ripple_sim.render",
)


def on_page_content(html: str, page: Any, **_: Any) -> str:
    """Put the line after each heading of a Python page that names something to import."""
    if not page.file.src_uri.startswith("python"):
        return html
    heading = r'<h3 id="(ripple_sim\.[\w.]+)" class="doc doc-heading">.*?</h3>'
    return re.sub(heading, lambda m: f"{m[0]}\n{_code(import_line(m[1]))}", html, flags=re.DOTALL)


def import_line(path: str) -> str:
    """The shortest line that imports what is at a path."""
    home, name = path.rsplit(".", 1)
    wanted = getattr(importlib.import_module(home), name)
    for public in PUBLIC:
        module = importlib.import_module(public)
        if name in getattr(module, "__all__", (name,)) and getattr(module, name, None) is wanted:
            return f"from {public} import {name}"
    return f"from {home} import {name}"


def _code(line: str) -> str:
    return f'<div class="highlight"><pre><code>{line}</code></pre></div>'
