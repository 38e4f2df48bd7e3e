# Copyright 2026 the ur_cartesian_driver contributors
# SPDX-License-Identifier: Apache-2.0
"""
Find links within a built site that lead to a missing file or anchor.

::

    python scripts/check_site.py build/site
"""

from __future__ import annotations

from html.parser import HTMLParser
from pathlib import Path
import sys
from urllib.parse import unquote, urlsplit


class Page(HTMLParser):
    """The anchors of a page, and the targets of its links."""

    def __init__(self, text: str) -> None:
        super().__init__()
        self.anchors: set[str] = set()
        self.links: list[str] = []
        self.feed(text)

    def handle_starttag(self, tag: str, attrs: list[tuple[str, str | None]]) -> None:
        """Collect the anchors and the link targets of a tag."""
        for name, value in attrs:
            if value is None:
                continue
            if name == 'id' or (name == 'name' and tag == 'a'):
                self.anchors.add(value)
            elif name in ('href', 'src'):
                self.links.append(value)


def broken_links(site: Path) -> list[str]:
    """Return a sentence for each link within the site whose target is missing."""
    pages = {path: Page(path.read_text(encoding='utf-8')) for path in site.rglob('*.html')}
    found = []
    for path, page in pages.items():
        for link in page.links:
            parts = urlsplit(link)
            if parts.scheme or parts.netloc:
                continue
            target = (path.parent / unquote(parts.path)).resolve() if parts.path else path
            anchor = unquote(parts.fragment)
            if not target.is_file():
                found.append(f'{path.relative_to(site)}: {link} is not there')
            elif anchor and target in pages and anchor not in pages[target].anchors:
                found.append(f'{path.relative_to(site)}: {link} has no such section')
    return found


def main() -> int:
    """Print broken links; return 1 if there are any, or if the site has no pages."""
    site = Path(sys.argv[1]).resolve()
    found = broken_links(site)
    pages = sum(1 for _ in site.rglob('*.html'))
    report = [*found, f'{pages} pages, {len(found)} broken links']
    sys.stdout.write('\n'.join(report) + '\n')
    return 1 if found or not pages else 0


if __name__ == '__main__':
    sys.exit(main())
