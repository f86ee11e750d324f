"""A small stand-in for a language model: it answers MEMO's prompts by keywords and naive habits."""
