# SPDX-License-Identifier: Apache-2.0
"""A report as a list of blocks: to Markdown, which leaves figures out, and to one HTML page without outside resources.
Texts and cells may hold `code`."""
import html
import re
import textwrap

import svg_plot

STYLE = """
:root { color-scheme: light dark; --text: #1d2127; --page: #fff; --rule: #d5d9df; --band: #f4f6f8 }
@media (prefers-color-scheme: dark) { :root { --text: #dfe3e8; --page: #14171b; --rule: #3a4048; --band: #1d2227 } }
body { margin: 0 auto; max-width: 76rem; padding: 0 1rem 3rem; color: var(--text); background: var(--page);
       font: 15px/1.5 system-ui, sans-serif }
h1 { font-size: 1.6rem } h2 { font-size: 1.2rem; margin-top: 2.2rem } p, li { max-width: 48rem }
a { color: inherit } nav a { margin-right: 1em; display: inline-block }
pre { background: var(--band); padding: .6rem .8rem; overflow-x: auto; border-radius: 4px }
.wide { overflow-x: auto }
table { border-collapse: collapse; font-size: 13px; font-variant-numeric: tabular-nums; margin: .8rem 0 }
th, td { padding: .25rem .6rem; border-bottom: 1px solid var(--rule); white-space: nowrap; text-align: right }
th { white-space: normal; vertical-align: bottom; background: var(--band) }
td:first-child, th:first-child { position: sticky; left: 0; text-align: left }
td:first-child { background: var(--page) }
figure { margin: 1.2rem 0 } figcaption { margin-bottom: .4rem; font-weight: 600 }
.plots { display: grid; grid-template-columns: repeat(auto-fill, minmax(min(300px, 100%), 1fr)); gap: .5rem 1rem }
.grid { display: flex; flex-wrap: wrap; gap: .8rem 2rem }
.pictures { display: flex; gap: 6px; overflow-x: auto; font-size: 12px; white-space: nowrap }
.pictures i { display: block; background-repeat: no-repeat; background-size: 200% 100%; border-radius: 3px }
img { max-width: 100% }
"""


class Heading:
    def __init__(self, text):
        self.text = text

    def markdown(self):
        return f"## {self.text}"

    def html(self):
        return f'<h2 id="{anchor(self.text)}">{inline(self.text)}</h2>'


class Text:
    def __init__(self, text):
        self.text = text

    def markdown(self):
        return wrapped(self.text)

    def html(self):
        return f"<p>{inline(self.text)}</p>"


class Items:
    def __init__(self, items):
        self.items = list(items)

    def markdown(self):
        return "\n".join(wrapped(f"- {item}", "  ") for item in self.items)

    def html(self):
        return "<ul>" + "".join(f"<li>{inline(item)}</li>" for item in self.items) + "</ul>"


class Code:
    def __init__(self, text):
        self.text = text

    def markdown(self):
        return textwrap.indent(self.text, "    ")

    def html(self):
        return f"<pre>{html.escape(self.text)}</pre>"


class Table:
    """header: the columns' names. rows: of strings, as many each."""

    def __init__(self, header, rows):
        self.header, self.rows = header, rows
        assert all(len(row) == len(header) for row in rows), header

    def markdown(self):
        lines = [self.header, ["---"] * len(self.header), *self.rows]
        return "\n".join(f"| {' | '.join(line)} |" for line in lines)

    def html(self):
        head = "".join(f"<th>{inline(name)}</th>" for name in self.header)
        body = "".join(f"<tr>{''.join(f'<td>{inline(cell)}</td>' for cell in row)}</tr>" for row in self.rows)
        return f'<div class="wide"><table><tr>{head}</tr>{body}</table></div>'


class Figure:
    """What only a page shows: HTML under a caption."""

    def __init__(self, caption, content):
        self.caption, self.content = caption, content

    def markdown(self):
        return ""

    def html(self):
        return f"<figure><figcaption>{inline(self.caption)}</figcaption>{self.content}</figure>"


def wrapped(text, indent=""):
    return textwrap.fill(text, 120, subsequent_indent=indent, break_long_words=False, break_on_hyphens=False)


def inline(text):
    return re.sub(r"`([^`]*)`", r"<code>\1</code>", html.escape(text, quote=False))


def anchor(heading):
    return re.sub(r"[^a-z0-9]+", "-", heading.lower()).strip("-")


def plots(caption, charts, lines):
    """charts: <svg>s, of which empty ones are left out. lines: what the legend names."""
    shown = "".join(charts)
    return Figure(caption, svg_plot.legend(lines) + f'<div class="plots">{shown}</div>') if shown else None


def markdown(title, blocks):
    parts = [f"# {title}", *(block.markdown() for block in blocks)]
    return "\n\n".join(part for part in parts if part) + "\n"


def page(title, blocks):
    links = "".join(f'<a href="#{anchor(block.text)}">{inline(block.text)}</a>' for block in blocks
                    if isinstance(block, Heading))
    body = "\n".join(block.html() for block in blocks)
    return (f'<!doctype html>\n<html lang="en"><head><meta charset="utf-8"><title>{inline(title)}</title>\n'
            f'<meta name="viewport" content="width=device-width, initial-scale=1">\n'
            f"<style>{STYLE}{svg_plot.STYLE}</style></head>\n<body><h1>{inline(title)}</h1>\n<nav>{links}</nav>\n"
            f"{body}\n</body></html>\n")
