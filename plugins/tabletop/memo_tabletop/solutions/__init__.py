"""Robot code written by hand; see ``memo_tabletop.reference``. Not modules of this package."""
