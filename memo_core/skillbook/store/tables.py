"""The tables of the book. Feedback is never overwritten; superseded entries stay until a person is forgotten."""

from __future__ import annotations

import sqlalchemy as sa

SCHEMA_VERSION = 7  # 2 to 7 have other caches, more tables, indexes and kinds than those before, and nothing else:
# opening an older book for writing makes them, after a backup (memo_core.skillbook.store.database)

metadata = sa.MetaData()
_ID = sa.BigInteger().with_variant(sa.Integer, "sqlite")

meta = sa.Table(  # schema_version, book, generation, embedder, dimension, created
    "meta",
    metadata,
    sa.Column("name", sa.String(40), primary_key=True),
    sa.Column("value", sa.Text, nullable=False),
)

feedback = sa.Table(
    "feedback",
    metadata,
    sa.Column("id", _ID, primary_key=True),
    sa.Column("kind", sa.String(20), nullable=False),  # correction, approval, edit
    sa.Column("words", sa.Text, nullable=False),  # verbatim
    sa.Column("who", sa.Text, nullable=False, index=True),
    sa.Column("time", sa.Float, nullable=False),  # s since the epoch
    sa.Column("task", sa.Text, nullable=False),
    sa.Column("subtask", sa.Text, nullable=False),
    sa.Column("scene", sa.Text, nullable=False),  # the scene's label
    sa.Column("scene_graph", sa.Text, nullable=False),  # as the prompt showed it
    sa.Column("code", sa.Text, nullable=False),
    sa.Column("run", sa.Text, nullable=False),
    sa.Column("status", sa.String(20), nullable=False, index=True),  # pending, processed, parked, kept
    sa.Column("reason", sa.Text, nullable=False),
    sqlite_autoincrement=True,
)

keys = sa.Table(
    "keys",
    metadata,
    sa.Column("id", _ID, primary_key=True),
    sa.Column("action", sa.Text, nullable=False),
    sa.Column("objects", sa.Text, nullable=False),  # JSON list; "[]" with the empty action: the global key
    sa.UniqueConstraint("action", "objects"),
    sqlite_autoincrement=True,
)

aliases = sa.Table(
    "aliases",
    metadata,
    sa.Column("spelling", sa.Text, primary_key=True),
    sa.Column("key", sa.ForeignKey("keys.id", ondelete="CASCADE"), nullable=False, index=True),
)

revisions = sa.Table(  # every change to the set of valid entries; rolling one back restores what it superseded
    "revisions",
    metadata,
    sa.Column("id", _ID, primary_key=True),
    sa.Column("key", sa.ForeignKey("keys.id", ondelete="SET NULL"), nullable=True, index=True),
    sa.Column("time", sa.Float, nullable=False),
    sa.Column("reason", sa.Text, nullable=False),  # feedback 3, template 4, cluster by offline, rollback of 7, ...
    sqlite_autoincrement=True,
)

entries = sa.Table(
    "entries",
    metadata,
    sa.Column("id", _ID, primary_key=True),
    sa.Column("kind", sa.String(20), nullable=False),  # correction, general, template, function, call
    sa.Column("key", sa.ForeignKey("keys.id"), nullable=False, index=True),
    sa.Column("text", sa.Text, nullable=False),
    sa.Column("scene", sa.Text, nullable=False),
    sa.Column("feedback", sa.ForeignKey("feedback.id", ondelete="SET NULL"), nullable=True),
    sa.Column("phase", sa.String(20), nullable=False),
    sa.Column("ordinal", sa.Integer, nullable=False),
    sa.Column("revision", sa.ForeignKey("revisions.id"), nullable=False, index=True),
    sa.Column("superseded_by", sa.ForeignKey("revisions.id"), nullable=True),
    sa.Column("uses", sa.Integer, nullable=False, server_default="0"),
    sa.Column("confirmed_uses", sa.Integer, nullable=False, server_default="0"),
    sa.Column("created", sa.Float, nullable=False),
    sa.UniqueConstraint("feedback", "phase", "ordinal"),
    sqlite_autoincrement=True,
)

_valid, _retired = entries.c.superseded_by.is_(None), entries.c.superseded_by.is_not(None)
valid_entries = sa.Index(  # counting and listing what is served never reads texts
    "ix_entries_valid", entries.c.key, entries.c.kind, entries.c.id, sqlite_where=_valid, postgresql_where=_valid
)
retired_entries = (
    sa.Index(  # partial: over all, SQLite takes it for the way to what is valid, which is nearly everything
        "ix_entries_retired", entries.c.superseded_by, sqlite_where=_retired, postgresql_where=_retired
    )
)
FORMER_INDEXES = ("ix_entries_superseded_by",)  # of schema versions 1 and 2
FORMER_TABLES = ("sketches", "sheets")  # caches of schema versions 3 to 5

sources = sa.Table(  # which feedback an entry derives from, for `forget`
    "sources",
    metadata,
    sa.Column("entry", sa.ForeignKey("entries.id", ondelete="CASCADE"), primary_key=True),
    sa.Column("feedback", sa.ForeignKey("feedback.id", ondelete="CASCADE"), primary_key=True, index=True),
)

vectors = sa.Table(  # a cache; the digest of the text, so that no words are kept twice
    "vectors",
    metadata,
    sa.Column("embedder", sa.String(200), primary_key=True),
    sa.Column("digest", sa.String(64), primary_key=True),
    sa.Column("vector", sa.LargeBinary, nullable=False),  # float32, little endian
)

changes = sa.Table(  # what a revision did to entries that it did not bring in itself
    "changes",
    metadata,
    sa.Column("revision", sa.ForeignKey("revisions.id", ondelete="CASCADE"), primary_key=True),
    sa.Column("entry", sa.ForeignKey("entries.id", ondelete="CASCADE"), primary_key=True, index=True),
    sa.Column("change", sa.String(20), nullable=False),  # superseded, restored, joined
    sa.Column("why", sa.Text, nullable=False),  # of "joined": the key it was under before
    sa.Column("because", sa.ForeignKey("entries.id", ondelete="SET NULL"), nullable=True),  # what it gave way to
)

clusterings = sa.Table(  # which state of a key was clustered last: as long as that is its state, it is passed over
    "clusterings",
    metadata,
    sa.Column("key", sa.ForeignKey("keys.id", ondelete="CASCADE"), primary_key=True),
    sa.Column("digest", sa.String(64), nullable=False),
    sa.Column("time", sa.Float, nullable=False),
    sa.Column("model", sa.Text, nullable=False),
)

groupings = sa.Table(  # which templates of several keys were considered together last: so they are not again
    "groupings",
    metadata,
    sa.Column("digest", sa.String(64), primary_key=True),
    sa.Column("time", sa.Float, nullable=False),
    sa.Column("model", sa.Text, nullable=False),  # "" for what no model was asked about
)

calls = sa.Table(  # which function a call calls: of its versions the active one
    "calls",
    metadata,
    sa.Column("entry", sa.ForeignKey("entries.id", ondelete="CASCADE"), primary_key=True),
    sa.Column("function", sa.ForeignKey("entries.id", ondelete="CASCADE"), primary_key=True, index=True),
)

entry_keys = sa.Table(  # further keys of a note that was said of several
    "entry_keys",
    metadata,
    sa.Column("entry", sa.ForeignKey("entries.id", ondelete="CASCADE"), primary_key=True),
    sa.Column("key", sa.ForeignKey("keys.id", ondelete="CASCADE"), primary_key=True, index=True),
)

records = sa.Table(  # how entries did when they were served to code for one key
    "records",
    metadata,
    sa.Column("entry", sa.ForeignKey("entries.id", ondelete="CASCADE"), primary_key=True),
    sa.Column("key", sa.ForeignKey("keys.id", ondelete="CASCADE"), primary_key=True),
    sa.Column("uses", sa.Integer, nullable=False),
    sa.Column("confirmed_uses", sa.Integer, nullable=False),
)

books = sa.Table(  # books that were imported
    "books",
    metadata,
    sa.Column("book", sa.String(100), primary_key=True),
    sa.Column("name", sa.Text, nullable=False),  # whose it is, as the person who imported it put it
    sa.Column("first", sa.Float, nullable=False),  # s since the epoch
    sa.Column("last", sa.Float, nullable=False),  # when it last brought something new
)

origins = sa.Table(  # where imported rows come from, and which are withdrawn: of these only the numbers are kept
    "origins",
    metadata,
    sa.Column("kind", sa.String(20), primary_key=True),  # feedback, entry, revision
    sa.Column("book", sa.String(100), primary_key=True),
    sa.Column("id", sa.String(100), primary_key=True),  # in that book
    sa.Column("local", sa.BigInteger, nullable=True, index=True),  # NULL: withdrawn
)

read_backs = sa.Table(  # what became of notes that were read back to a person, or edited or removed later
    "read_backs",
    metadata,
    sa.Column("id", _ID, primary_key=True),
    sa.Column("feedback", sa.ForeignKey("feedback.id", ondelete="CASCADE"), nullable=False, index=True),
    sa.Column("entry", sa.ForeignKey("entries.id", ondelete="SET NULL"), nullable=True),
    sa.Column("who", sa.Text, nullable=False, index=True),
    sa.Column("time", sa.Float, nullable=False),  # s since the epoch
    sa.Column("outcome", sa.String(20), nullable=False),  # accepted, reworded, struck
    sa.Column("note", sa.Text, nullable=False),  # as it was read back
    sa.Column("text", sa.Text, nullable=False),  # as it was reworded; "" otherwise
    sqlite_autoincrement=True,
)

answers = sa.Table(  # a language model's answers, so that a book rebuilt twice is the same book twice
    "answers",
    metadata,
    sa.Column("digest", sa.String(64), primary_key=True),  # of the question and the model's name
    sa.Column("phase", sa.String(20), nullable=False),
    sa.Column("model", sa.Text, nullable=False),
    sa.Column("answer", sa.Text, nullable=False),
    sa.Column("time", sa.Float, nullable=False),  # s since the epoch
)

answer_sources = sa.Table(  # which feedback a question was about, for `forget`
    "answer_sources",
    metadata,
    sa.Column("digest", sa.ForeignKey("answers.digest", ondelete="CASCADE"), primary_key=True),
    sa.Column("feedback", sa.ForeignKey("feedback.id", ondelete="CASCADE"), primary_key=True, index=True),
)

trials = sa.Table(  # how templates did when they were run again in simulation (`memo skillbook retest`)
    "trials",
    metadata,
    sa.Column("entry", sa.ForeignKey("entries.id", ondelete="CASCADE"), primary_key=True),
    sa.Column("start", sa.String(200), primary_key=True),  # which stored start, or which seed of the task
    sa.Column("success", sa.Boolean, nullable=False),
    sa.Column("time", sa.Float, nullable=False),  # s since the epoch
    sa.Column("reason", sa.Text, nullable=False),  # why it did not succeed
)

places = sa.Table(  # files and folders that may hold words of the book's people, for `forget`
    "places",
    metadata,
    sa.Column("path", sa.Text, primary_key=True),
    sa.Column("kind", sa.String(20), nullable=False),  # run, recording, export, backup, book
    sa.Column("time", sa.Float, nullable=False),  # s since the epoch
)

# The last entry of each run's log that wrote to the book: after a crash it tells whether it did.
run_effects = sa.Table(
    "run_effects",
    metadata,
    sa.Column("run", sa.String(200), primary_key=True),
    sa.Column("entry", sa.BigInteger, nullable=False),
    sa.Column("note", sa.Text, nullable=False),  # what the run needs to go on from there; no words of people
)
