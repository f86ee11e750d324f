"""What this distribution offers to MEMO. Only declares: nothing heavy is imported here."""

from __future__ import annotations
