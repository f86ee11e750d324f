"""The control contract: what generated code may call, declared once. Documentation, stubs and checks derive from it."""
