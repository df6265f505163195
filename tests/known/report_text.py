"""The report as its reader sees it: with the pages of cells and groups unpacked."""

import base64
import gzip
import re

PACKED = re.compile(r'<script type="application/gzip">([^<]*)</script>')


def unpacked(html):
    """Text of a report in which each compressed page stands unpacked in its place."""
    return PACKED.sub(lambda page: gzip.decompress(base64.b64decode(page[1])).decode(), html)
