"""The backends that need nothing but the core, declared with the same hooks as anybody's."""

from __future__ import annotations
