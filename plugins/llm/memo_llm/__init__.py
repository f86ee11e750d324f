"""Language backends for MEMO: litellm and replay."""
