"""The web server's process: the guard, the state that pages show, and the pages."""
