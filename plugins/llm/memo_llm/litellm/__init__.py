"""The ``litellm`` backend: any provider that litellm knows, and any server that speaks OpenAI's protocol."""
