"""``memo suites``."""
import typer
app = typer.Typer()
