"""A repository with a champion."""

from __future__ import annotations

from champion_repository import champion_root

__all__ = ["champion_root"]
