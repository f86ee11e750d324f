"""The demo: a task fails, is taught and succeeds; a second task uses the lesson."""
