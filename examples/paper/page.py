"""A page of the paper's parts with pictures and figures, as HTML or as Markdown."""

import dataclasses
import html
from collections.abc import Sequence
from pathlib import Path

from PIL import Image

_STYLE = """
body { font: 16px/1.55 system-ui, sans-serif; color: #1b2432;
  max-width: 62rem; margin: 2.5rem auto; padding: 0 1rem }
h1 { font-size: 2rem; line-height: 1.2 } h2 { margin-top: 3rem }
figure { margin: 1.2rem 0 } img { max-width: 100%; border-radius: 6px }
figcaption, code { color: #57606d; font-size: .9em }
table { border-collapse: collapse; margin: 1.2rem 0 }
th, td { padding: .3rem .9rem; text-align: right; border-bottom: 1px solid #dfe3e8 }
th:first-child, td:first-child { text-align: left }
"""


@dataclasses.dataclass(frozen=True)
class Part:
    """One part of the paper.

    Pictures are (file, caption); a table's first row is its head; `live` names the scene of a live
    page, which the built documentation shows.
    """

    title: str
    text: str
    pictures: Sequence[tuple[Path, str]] = ()
    table: Sequence[Sequence[str]] = ()
    live: str = ""


def write_page(path: Path, title: str, lead: str, parts: Sequence[tuple[str, Part]]) -> None:
    """Write an HTML page; each part comes with the command that makes it alone."""
    pieces = [f"<h1>{html.escape(title)}</h1><p>{html.escape(lead)}</p>"]
    for command, part in parts:
        pieces.append(f"<h2>{html.escape(part.title)}</h2><p>{html.escape(part.text)}</p>")
        for file, caption in part.pictures:
            source = html.escape(file.relative_to(path.parent).as_posix())
            pieces.append(
                f'<figure><img src="{source}" '
                f'alt=""><figcaption>{html.escape(caption)}</figcaption></figure>'
            )
        if part.table:
            rows = [
                "".join(f"<{tag}>{html.escape(cell)}</{tag}>" for cell in row)
                for tag, row in zip(
                    ["th"] + ["td"] * (len(part.table) - 1), part.table, strict=True
                )
            ]
            pieces.append("<table>" + "".join(f"<tr>{row}</tr>" for row in rows) + "</table>")
        pieces.append(f"<p><code>{html.escape(command)}</code></p>")
    body = "\n".join(pieces)
    path.write_text(
        f'<!doctype html><html lang="en"><meta charset="utf-8"><title>{html.escape(title)}</title>'
        f"<style>{_STYLE}</style>\n{body}\n</html>\n",
        encoding="utf-8",
    )


def write_markdown(path: Path, title: str, lead: str, parts: Sequence[tuple[str, Part]]) -> None:
    """Write the page in Markdown, its pictures as WebP in a folder of the page's name beside it."""
    folder = path.with_suffix("")
    folder.mkdir(exist_ok=True)
    pieces = [f"# {title}", lead]
    for command, part in parts:
        pieces += [f"## {part.title}", part.text]
        if part.live:
            pieces.append(f"<!-- player: {part.live} -->")
        for file, caption in part.pictures:
            picture = Image.open(file).convert("RGB")
            picture.thumbnail((1400, 1400))
            small = folder / f"{file.stem}.webp"
            picture.save(small, quality=80, method=6)
            pieces.append(f"![{caption}]({folder.name}/{small.name})\n\n*{caption}*")
        if part.table:
            rows = [part.table[0], ["---"] * len(part.table[0]), *part.table[1:]]
            pieces.append("\n".join(f"| {' | '.join(row)} |" for row in rows))
        pieces.append(f"`{command}`")
    path.write_text("\n\n".join(pieces) + "\n", encoding="utf-8")
