"""``memo bench fuzz``: damaged and hostile input of six kinds, given to the commands that read it.

``mutations`` damages text, bytes and JSON; a file a kind says what is damaged and which commands read it; ``child`` is
the process in which the commands run, ``bench`` the one that draws, waits, kills and counts.
"""
