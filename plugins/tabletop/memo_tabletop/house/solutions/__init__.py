"""Robot code written by hand, read by ``memo_tabletop.quirks.code``. Not modules of this package."""
