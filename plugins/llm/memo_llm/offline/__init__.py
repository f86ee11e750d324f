"""The offline language backend: a deterministic, rule-based reader of MEMO's prompts (docs/offline-backend.md)."""
