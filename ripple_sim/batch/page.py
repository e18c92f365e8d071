"""The summary page of a batch."""

from __future__ import annotations

import html
from typing import Any

from ripple_sim.solver.files import atomic_write

from .folder import BatchFolder

_MOST = 5_000  # scenes on the page

_HEAD = """<!doctype html><meta charset="utf-8"><title>{name}</title><style>
body{{font:15px system-ui,sans-serif;margin:2rem;color:#222;background:#fafafa}}
main{{display:grid;grid-template-columns:repeat(auto-fill,minmax(170px,1fr));gap:12px}}
a{{display:block;background:#fff;border-radius:6px;padding:5px;color:inherit;text-decoration:none;font-size:12px;
box-shadow:0 1px 3px #0003}}img{{width:100%;display:block;border-radius:3px}}.failed{{background:#fdd}}
</style><h1>{name}</h1><p>{summary}</p><main>
"""


def write_page(batch: BatchFolder, rows: list[dict[str, Any]]) -> None:
    """Write `index.html`: a thumbnail a scene, with what was drawn for it, and what the whole took."""
    finished = [row for row in rows if row["status"] == "finished"]
    frames, size, seconds = (sum(row[key] for row in finished) for key in ("frames", "bytes", "seconds"))
    shown = f"; the first {_MOST} are shown" if len(rows) > _MOST else ""
    summary = (
        f"{len(finished)} scenes, {frames} frames, {size / 1e6:.1f} MB, {seconds:.0f} s of work; "
        f"{len(rows) - len(finished)} failed{shown}"
    )
    cards = "".join(_card(batch, row) for row in rows[:_MOST])
    name = html.escape(batch.path.name)
    with atomic_write(batch.page) as path:
        path.write_text(_HEAD.format(name=name, summary=summary) + cards + "</main>\n", encoding="utf-8")


def _card(batch: BatchFolder, row: dict[str, Any]) -> str:
    number = row["number"]
    if row["status"] != "finished":
        log = f"failed/{number:06d}.log"
        return f'<a class="failed" href="{log}">{number}: {html.escape(str(row["error"]))}</a>\n'
    title = html.escape("\n".join(f"{name}: {value}" for name, value in row.items()), quote=True)
    thumbnail = batch.thumbnail(number)
    image = f'<img loading="lazy" src="thumbnails/{thumbnail.name}" alt="">' if thumbnail.exists() else ""
    folder = batch.scene(number)
    link = f"scenes/{folder.name}/" if folder.exists() else "tars/"
    text = f"{number}: {html.escape(row['source'])}, {row['impulse']:.3g} N s"
    return f'<a href="{link}" title="{title}">{image}{text}</a>\n'
