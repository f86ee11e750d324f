"""Plugins: hook specifications, discovery, and the registry of backends."""

from typing import TYPE_CHECKING

from memo_core.lazy_exports import lazy_exports

if TYPE_CHECKING:
    from memo_core.plugins.hooks import hookimpl as hookimpl
    from memo_core.plugins.installing import reinstall as reinstall
    from memo_core.plugins.registry import Registry as Registry

__all__, __getattr__, __dir__ = lazy_exports(__name__, __file__)
